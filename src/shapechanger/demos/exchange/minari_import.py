"""Reads Minari datasets of others, as far as layouts can be made for their spaces.

At most one part of an observation is a picture; all other numbers become the state, in order, and
those of an action the action. Nobody says their units, so each is "?". Pictures that Minari stores
as JPEG stay as they are; others are encoded as JPEG of quality 100, which changes them a little.
Who acted is not said: it is an "expert" here. The rate is that of the key `control_hz`, or 20 Hz.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, cast

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from shapechanger.demos.episodes import DRIVERS, EpisodeHeader, Step
from shapechanger.demos.exchange import minari_format as files
from shapechanger.demos.exchange.minari_format import (
    Leaf,
    column,
    is_picture,
    layout_of,
    leaves_of,
    open_hdf5,
    stored_as_jpeg,
)
from shapechanger.demos.exchange.pictures import MAX_PIXELS, Pictures, encode, library
from shapechanger.demos.exchange.places import inside, read_text
from shapechanger.demos.exchange.recorded import HZ_UNKNOWN, ExchangeStep, Recorded
from shapechanger.errors import DemosError, MissingExtra, UnknownName

__all__ = ["read_foreign", "read_minari", "read_own"]

_CHUNK: Final = 64  # Steps that are in memory at once; pictures may be large.


def read_foreign(
    main: Path,
    observations: spaces.Space[Any],
    actions: spaces.Space[Any],
    count: int,
    *,
    jpeg: bool,
    said: dict[str, Any],
) -> Iterator[Recorded]:
    """The episodes of a dataset.

    Args:
        main: The HDF5 file.
        observations: Space of its observations.
        actions: Space of its actions.
        count: How many episodes there are.
        jpeg: Whether pictures are stored as JPEG where Minari can.
        said: What the metadata say besides: `dataset_id` and `control_hz`, or neither.

    Raises:
        DemosError: If no layout can be made, or something is not whole.
    """
    seen = list(leaves_of(observations))
    pictured = [leaf for leaf in seen if is_picture(leaf.space)]
    if len(pictured) > 1:
        raise DemosError(
            f"An observation in {main} has {len(pictured)} pictures "
            f"({', '.join(leaf.name for leaf in pictured)}), and an episode has one camera: leave "
            "one of them in the dataset."
        )
    numbers = [leaf for leaf in seen if leaf not in pictured]
    acted = list(leaves_of(actions))
    layout = layout_of(acted, "action")
    state = layout_of(numbers, "observation") if numbers else None
    hz = said.get("control_hz")
    known = isinstance(hz, int | float) and math.isfinite(hz) and hz > 0.0
    header = EpisodeHeader(
        action_layout=layout.to_json(),
        state_layout="" if state is None else state.to_json(),
        image_size=_size(pictured[0]) if pictured else None,
        control_hz=float(hz) if isinstance(hz, int | float) and known else HZ_UNKNOWN,
        clock="none",
        source="minari",
        notes={"dataset": str(said.get("dataset_id", "")), "rate_is_known": known},
    )
    as_jpeg = jpeg and bool(pictured) and stored_as_jpeg(pictured[0].space)
    for number in range(count):
        group = f"episode_{number}"
        rows = _rows(main, group, acted, numbers, pictured, as_jpeg=as_jpeg, size=header.image_size)
        yield Recorded(header=header, rows=rows, name=f"{main}, {group}")


def _rows(
    main: Path,
    group: str,
    acted: Sequence[Leaf],
    numbers: Sequence[Leaf],
    pictured: Sequence[Leaf],
    *,
    as_jpeg: bool,
    size: tuple[int, int] | None,
) -> Iterator[ExchangeStep]:
    pictures = Pictures(size)
    with open_hdf5(main) as file:
        rewards = column(file, f"{group}/rewards", main)
        steps = int(rewards.shape[0])

        def columns(leaves: Sequence[Leaf], of: str) -> list[Any]:
            return [column(file, "/".join((group, of, *leaf.path)), main, steps) for leaf in leaves]

        action, state = columns(acted, "actions"), columns(numbers, "observations")
        frames = columns(pictured, "observations")
        ends = [column(file, f"{group}/{n}", main, steps) for n in ("terminations", "truncations")]
        for start in range(0, steps, _CHUNK):
            part = slice(start, min(start + _CHUNK, steps))
            actions, states = _flat(action, acted, part, main), _flat(state, numbers, part, main)
            worth, over, cut = rewards[part], ends[0][part], ends[1][part]
            seen = frames[0][part] if frames else None
            for place in range(part.stop - start):
                where = f"of step {start + place} of {group} in {main}"
                reward = float(worth[place])
                if not np.isfinite(actions[place]).all():
                    raise DemosError(f"The action {where} is not finite: take the episode out.")
                step = Step(
                    action=tuple(actions[place].tolist()),
                    driver="expert",
                    state=tuple(states[place].tolist()),
                    reward=None if math.isnan(reward) else reward,
                    terminated=bool(over[place]),
                    truncated=bool(cut[place]),
                )
                jpeg = None
                if seen is not None and as_jpeg:
                    jpeg = bytes(seen[place])
                    pictures.check(jpeg, where)
                elif seen is not None:
                    jpeg = _encoded(np.asarray(seen[place]), size, where)
                yield ExchangeStep(step=step, jpeg=jpeg)


def _flat(
    columns: Sequence[Any], leaves: Sequence[Leaf], part: slice, main: Path
) -> NDArray[np.float64]:
    """The numbers of some steps, shape (n, size of all leaves)."""
    steps = part.stop - part.start
    flat = [np.empty((steps, 0))]
    for values, leaf in zip(columns, leaves, strict=True):
        try:
            numbers = np.asarray(values[part], np.float64).reshape(steps, -1)
        except (ValueError, TypeError) as error:
            raise DemosError(f"{main}: {values.name!r} holds no numbers ({error}).") from error
        size = max(1, math.prod(leaf.space.shape or ()))
        if numbers.shape[1] != size:
            raise DemosError(
                f"{main}: {values.name!r} has {numbers.shape[1]} numbers a step, and its space "
                f"has {size}."
            )
        flat.append(numbers)
    return np.concatenate(flat, axis=1)


def _encoded(pixels: NDArray[Any], size: tuple[int, int] | None, where: str) -> bytes:
    """A picture as JPEG."""
    if pixels.ndim == 2:
        pixels = pixels[..., None]
    elif pixels.ndim == 3 and _colours_first(pixels.shape):
        pixels = np.moveaxis(pixels, 0, -1)
    if pixels.dtype != np.uint8 or pixels.ndim != 3 or pixels.shape[1::-1] != size:
        raise DemosError(f"The picture {where} is not as its space says: create the dataset anew.")
    return encode(np.repeat(pixels, 3, -1) if pixels.shape[-1] == 1 else pixels)


def _colours_first(shape: tuple[int, ...]) -> bool:
    return shape[0] in {1, 3} and shape[2] not in {1, 3}


def _size(leaf: Leaf) -> tuple[int, int]:
    """Width and height of the pictures of a space, in pixels.

    Raises:
        DemosError: If they are larger than pictures can be.
    """
    shape = leaf.space.shape or (0, 0)
    first = 1 if len(shape) == 3 and _colours_first(shape) else 0
    height, width = shape[first], shape[first + 1]
    if height * width > MAX_PIXELS:
        raise DemosError(
            f"The pictures of {leaf.name or 'the observation'} have {width} x {height} pixels, and "
            f"at most {MAX_PIXELS} are read: make them smaller."
        )
    return width, height


_MINARI_OWN_CHUNK: Final = 256  # Steps that are in memory at once.
_ALWAYS: Final = (
    "actions",
    "rewards",
    "terminations",
    "truncations",
    "infos/rewarded",
    "infos/applied",
    "infos/has_applied",
    "infos/wanted",
    "infos/has_wanted",
    *(f"infos/{name}" for name in files.TIMES),
    "infos/driver",
    "infos/stop_reason",
    "infos/more",
)


def read_own(main: Path, said: object, count: int) -> Iterator[Recorded]:
    """The episodes of a dataset.

    Args:
        main: The HDF5 file.
        said: What `metadata.json` says of the headers.
        count: How many episodes there are.

    Raises:
        DemosError: If something in it is not whole.
    """
    fields = cast("dict[str, Any]", said) if isinstance(said, dict) else {}
    headers = fields.get("episodes")
    if fields.get("format") != files.HEADERS_FORMAT or not isinstance(headers, list):
        raise DemosError(
            f"{main.with_name(files.METADATA)} was written by another version of Shapechanger: "
            f"this one reads format {files.HEADERS_FORMAT}."
        )
    plain = cast("list[dict[str, Any]]", headers)
    if len(plain) != count:
        raise DemosError(
            f"{main.with_name(files.METADATA)} has the headers of {len(plain)} episodes, and says "
            f"that there are {count}."
        )
    for number, header in enumerate(plain):
        where = f"{main.with_name(files.METADATA)}, episode {number}"
        try:
            known = EpisodeHeader.from_json(header)
        except DemosError as error:
            raise DemosError(f"{where}: {error}") from error
        yield Recorded(
            header=known,
            rows=_minari_own_rows(main, f"episode_{number}", known),
            name=where,
            outcome=str(header.get("outcome", "")),
        )


def _minari_own_rows(main: Path, group: str, header: EpisodeHeader) -> Iterator[ExchangeStep]:
    pictures = Pictures(header.image_size)
    frame = -1
    with open_hdf5(main) as file:
        steps = int(column(file, f"{group}/rewards", main).shape[0])
        names = dict.fromkeys(_ALWAYS, "") | _observed(file, group, header)
        columns = {
            name: column(file, f"{group}/{place or name}", main, steps)
            for name, place in names.items()
        }
        cut_off = bool(column(file, f"{group}/infos/cut_off", main, 1)[0])
        for start in range(0, steps, _MINARI_OWN_CHUNK):
            chunk = {
                name: values[start : start + _MINARI_OWN_CHUNK] for name, values in columns.items()
            }
            for place in range(min(_MINARI_OWN_CHUNK, steps - start)):
                at = {name: values[place] for name, values in chunk.items()}
                where = f"{main}, step {start + place} of {group}"
                step, marks, dropped = _step(at, where)
                if cut_off and start + place == steps - 1:
                    step = replace(step, truncated=False)
                jpeg = None
                if "infos/frame" in at and int(at["infos/frame"]) != frame:
                    frame = int(at["infos/frame"])
                    jpeg = bytes(at[files.JPEG])
                    pictures.check(jpeg, f"of {where}")
                yield ExchangeStep(step=step, jpeg=jpeg, marks=marks, dropped=dropped)


def _observed(file: Any, group: str, header: EpisodeHeader) -> dict[str, str]:
    """The places of picture and state."""
    pictured = f"{group}/infos/frame" in file
    state = bool(header.state_layout)
    places: dict[str, str] = {}
    if state:
        places[files.STATE] = f"observations/{files.STATE}" if pictured else "observations"
    if pictured:
        beside = f"infos/{files.JPEG}"
        inside = f"observations/{files.IMAGE}" if state else "observations"
        places |= {
            files.JPEG: beside if f"{group}/{beside}" in file else inside,
            "infos/frame": "infos/frame",
        }
    return places


def _step(at: dict[str, Any], where: str) -> tuple[Step, tuple[str, ...], str | None]:
    """A step, its marks, and why it does not count."""
    try:
        more = json.loads(at["infos/more"])
        driver = at["infos/driver"].decode()
        times = {name: int(at[f"infos/{name}"]) for name in files.TIMES}
        step = Step(
            action=_vector(at["actions"]),
            driver=driver,
            applied=_vector(at["infos/applied"]) if at["infos/has_applied"] else None,
            wanted=_vector(at["infos/wanted"]) if at["infos/has_wanted"] else None,
            state=_vector(at[files.STATE]) if files.STATE in at else (),
            captured_ns=_known(times["captured_ns"]),
            decided_ns=_known(times["decided_ns"]),
            wall_ns=_known(times["wall_ns"]),
            reward=float(at["rewards"]) if at["infos/rewarded"] else None,
            terms={name: float(value) for name, value in more.get("terms", {}).items()},
            terminated=bool(at["terminations"]),
            truncated=bool(at["truncations"]),
            stop_reason=str(more.get("stop_reason", at["infos/stop_reason"].decode())),
        )
        marks = tuple(str(mark) for mark in more.get("marks", ()))
        dropped = more.get("dropped")
    except (ValueError, TypeError, AttributeError, LookupError) as error:
        raise DemosError(f"{where} cannot be read: {error}.") from error
    if driver not in DRIVERS:
        raise DemosError(f"{where}: {UnknownName('driver', driver, DRIVERS)}")
    return step, marks, None if dropped is None else str(dropped)


def _vector(values: Any) -> tuple[float, ...]:
    return tuple(float(value) for value in values)


def _known(time_ns: int) -> int | None:
    return None if time_ns == files.UNKNOWN_NS else time_ns


def read_minari(folder: Path) -> Iterator[Recorded]:
    """The episodes of a dataset; neither Minari's own folder nor the network is used.

    Raises:
        DemosError: If something in it is not whole, or no layout can be made for its spaces.
        MissingExtra: If Minari or h5py is not installed.
    """
    place = files.data_folder(folder)
    if place is None:
        raise DemosError(f"There is no Minari dataset in {folder}: one has {files.METADATA}.")
    path = place / files.METADATA
    try:
        plain = json.loads(read_text(path))
    except (ValueError, RecursionError) as error:
        raise DemosError(f"{path} is no JSON: {error}.") from error
    if not isinstance(plain, dict):
        raise DemosError(f"{path} is no metadata of a Minari dataset.")
    metadata = cast("dict[str, Any]", plain)
    if metadata.get("data_format", "hdf5") != "hdf5":
        raise DemosError(
            f"{folder} is stored as {metadata['data_format']!r}, and only 'hdf5' is read: create "
            "it with data_format='hdf5'."
        )
    main = inside(place, files.MAIN, str(path))
    count = metadata.get("total_episodes")
    if not isinstance(count, int) or isinstance(count, bool) or count < 1:
        raise DemosError(f"{path} says that there are {count!r} episodes.")
    if files.HEADERS in metadata:
        yield from read_own(main, metadata[files.HEADERS], count)
        return
    yield from read_foreign(
        main,
        _space(metadata, "observation_space", path),
        _space(metadata, "action_space", path),
        count,
        jpeg=bool(metadata.get("jpeg_encoding", True)),
        said={name: metadata[name] for name in ("dataset_id", "control_hz") if name in metadata},
    )


def _space(metadata: dict[str, Any], name: str, path: Path) -> spaces.Space[Any]:
    text = metadata.get(name)
    if not isinstance(text, str):
        raise DemosError(
            f"{path} has no {name}, so nobody knows what its numbers are: create the dataset anew "
            "with this space."
        )
    try:
        return library("minari.serialization").deserialize_space(text)
    except MissingExtra:
        raise
    except Exception as error:  # What it raises for nonsense is not written down.
        raise DemosError(f"The {name} in {path} cannot be read: {error}.") from error
