"""Minari datasets: ours without a loss, and those of others as far as possible.

An observation is the picture, the state, or a dictionary of both. A picture is stored as the JPEG
that was recorded, which Minari decodes on reading; it is not encoded again. Pictures below 32
pixels, which Minari does not store as JPEG, are stored as pixels, with the JPEG in `infos/jpeg`.
Minari needs one observation more than there are steps, so the last one is repeated.

In the infos of a step, `has_applied` and `has_wanted` say whether these actions are known, and
`rewarded` whether the reward is, which is NaN if not; an unknown time is -2^63; `frame` is the
index of the picture in the episode, the same for steps that share one; `more` is JSON of the
rest. `cut_off` says whether an end was added. The headers of the episodes, the layouts and the rate
are in `metadata.json`.

Of a dataset of others, at most one part of an observation may be a picture; all other values become
the state, in order. Pictures that are not JPEG are encoded with quality 100. The driver is unknown
and taken to be an "expert". The rate is that of the key `control_hz`, that of `--hz`, or 20 Hz.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, cast

import msgspec
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from shapechanger.demos.episodes import DRIVERS, EpisodeHeader, Step
from shapechanger.demos.exchange.files import (
    MAX_FEATURES,
    MAX_UNPACKED,
    MAX_VALUES,
    UNIT_UNKNOWN,
    chunk_of,
    column,
    inside,
    library,
    names_in,
    open_hdf5,
    own_headers,
    parse_json,
    read_json_object,
)
from shapechanger.demos.exchange.format import (
    DEFAULT_HZ,
    ExchangeEpisode,
    ExchangeStep,
    Format,
    ImportContext,
    few,
    fields_of,
    name_in,
)
from shapechanger.demos.exchange.minari_export import (
    CUT_OFF,
    DATA,
    FRAME,
    JPEG,
    MAIN,
    METADATA,
    OBSERVATIONS,
    OURS,
    UNKNOWN_NS,
    stored_as_jpeg,
    write_minari,
)
from shapechanger.demos.exchange.pictures import Pictures
from shapechanger.demos.jpeg import MAX_PIXELS, encode_picture
from shapechanger.errors import DemosError, MissingExtra, UnknownName
from shapechanger.layout import Feature, Layout

_CHUNK: Final = 64  # Steps in memory at once; pictures may be stored as pixels.
_MIN_PICTURE: Final = 8  # Pixels. A smaller grid is a map, not a picture.
_CHANNELS: Final = (1, 3)
_DEEP: Final = (np.uint16, np.int16, np.uint32)
_TIMES: Final = fields_of("time")
_ACTION, _REWARD, _TERMINATED, _TRUNCATED = (
    name_in("minari", field) for field in ("action", "reward", "terminated", "truncated")
)
_DRIVER, _STOP, _MORE = (name_in("minari", field) for field in ("driver", "stop_reason", "terms"))
_INFOS: Final = (
    *(f"infos/{name}" for name in ("rewarded", "has_applied", "has_wanted", *_TIMES)),
    *("infos/applied", "infos/wanted", _DRIVER, _STOP, _MORE),
)


def _data_folder(folder: Path) -> Path | None:
    """Return the folder with the files of a dataset: `data`, or `folder` itself; None for none."""
    return next((p for p in (folder / DATA, folder) if (p / METADATA).is_file()), None)


def read_minari(folder: Path, context: ImportContext) -> Iterator[ExchangeEpisode]:
    """Yield the episodes of a dataset."""
    place = _data_folder(folder) or folder
    path = place / METADATA
    metadata = read_json_object(path)
    if metadata.get("data_format", "hdf5") != "hdf5":
        raise DemosError(
            f"{folder} is stored as {metadata['data_format']!r}, but only 'hdf5' is supported: "
            "create it with data_format='hdf5'."
        )
    main = inside(place, MAIN, path)
    count = metadata.get("total_episodes")
    if not isinstance(count, int) or isinstance(count, bool) or count < 1:
        raise DemosError(f"{path}: total_episodes must be a positive integer, got {count!r}.")
    _require_stored(main, count)
    ours = own_headers(metadata[OURS], path) if OURS in metadata else []
    if OURS in metadata and len(ours) != count:
        raise DemosError(
            f"{path} has the headers of {len(ours)} episodes, but total_episodes is {count}."
        )
    theirs = None if ours else _foreign(main, path, metadata, context)
    for number in range(count):
        try:
            with open_hdf5(main) as file:
                parts = theirs or _own(file, number, ours[number])
                steps = parts.require_whole(file, number, context)
        except DemosError as error:
            why = str(error).removesuffix(".")
            context.leave_out("episode", f"that cannot be read ({why})", number)
            continue
        yield ExchangeEpisode(
            header=parts.header,
            rows=_rows(main, number, steps, parts, context),
            name=f"{main}, episode_{number}",
            outcome=str(ours[number].get("outcome", "")) if ours else "",
        )
    if not ours:
        with open_hdf5(main) as file:
            groups = [name for name in names_in(file) if name.startswith("episode_")]
            more = {name for group in groups for name in names_in(file, group, "infos")}
        if len(groups) != count:
            context.warn(f"total_episodes is {count}, and {main.name} has {len(groups)} episodes.")
        if more:
            context.note(f"The infos are not imported: {few(sorted(more))}.")


def _require_stored(main: Path, count: int) -> None:
    """Refuse a file that claims more steps than it has bytes.

    HDF5 stores empty arrays of any size in no bytes, and one array under any number of names.
    """
    size, claimed = main.stat().st_size, 0
    with open_hdf5(main) as file:
        for number in range(count):
            for name in (_REWARD, _TERMINATED, _TRUNCATED):
                with suppress(DemosError):  # It is left out later.
                    claimed += int(column(file, f"episode_{number}/{name}").shape[0])
            if claimed > size:
                raise DemosError(f"{main} claims at least {claimed} values, but has {size} bytes.")


@dataclass(frozen=True, slots=True)
class _Parts:
    """Columns of an episode, some with their number of values; "" without pictures."""

    header: EpisodeHeader
    action: Sequence[tuple[str, int]]
    state: Sequence[tuple[str, int]]
    picture: str
    is_jpeg: bool
    infos: Sequence[str] = ()  # Of our own; () in a dataset of others.

    def columns(self, file: Any, number: int) -> dict[str, Any]:
        """Return the columns by name; those of rewards may be missing."""
        group = f"episode_{number}"
        names = [_TERMINATED, _TRUNCATED, *(name for name, _ in (*self.action, *self.state))]
        names += [*self.infos, *([self.picture] if self.picture else [])]
        if self.infos or _REWARD in names_in(file, group):
            names.append(_REWARD)
        return {name: column(file, f"{group}/{name}") for name in names}

    def require_whole(self, file: Any, number: int, context: ImportContext) -> int:
        """Refuse an episode whose columns have different lengths; return the number of steps."""
        columns = self.columns(file, number)
        ends = columns[_TERMINATED]
        steps = int(ends.shape[0])
        if _REWARD not in columns:
            context.warn(f"{Path(file.filename).name} has no rewards: the steps have none.")
        observed = {self.picture, *(name for name, _ in self.state)} - {JPEG}
        for name, found in columns.items():
            have = found.shape[0]
            if name in observed and have not in {steps, steps + 1}:
                # The last observation follows the last step.
                raise DemosError(f"{found.name!r} has {have} entries, but {steps + 1} are needed.")
            if name not in observed and have != steps:
                raise DemosError(f"{found.name!r} has {have} entries, but {ends.name!r} {steps}.")
        stated = file[f"episode_{number}"].attrs.get("total_steps", steps)
        if not np.array_equal(np.ravel(stated), [steps]):
            raise DemosError(
                f"episode_{number} has {steps} steps, and its total_steps says {stated}."
            )
        return steps


def _own(file: Any, number: int, plain: dict[str, Any]) -> _Parts:
    """Return where the parts of an episode are that Shapechanger exported."""
    header = EpisodeHeader.from_json(plain)
    infos = names_in(file, f"episode_{number}", "infos")
    pictured = "frame" in infos
    both = pictured and header.state_layout
    state, picture = (name_in("minari", f) if both else OBSERVATIONS for f in ("state", "frame"))
    return _Parts(
        header=header,
        action=[(_ACTION, header.action_size)],
        state=[(state, header.state_size)] if header.state_layout else [],
        picture=(JPEG if "jpeg" in infos else picture) if pictured else "",
        is_jpeg=True,
        infos=(*_INFOS, FRAME) if pictured else _INFOS,
    )


def _foreign(main: Path, path: Path, metadata: dict[str, Any], context: ImportContext) -> _Parts:
    """Return where the parts of the episodes of a dataset of others are."""
    observed, acted = (
        _leaves_in(metadata, f"{of}_space", path) for of in ("observation", "action")
    )
    pictured = {name: space for name, space in observed.items() if _picture_size(space)}
    if len(pictured) > 1:
        raise DemosError(
            f"An observation in {main} has {len(pictured)} pictures ({', '.join(pictured)}), but "
            "an episode has one camera: keep one of them in the dataset."
        )
    sensed = {
        name: space
        for name, space in observed.items()
        if name not in pictured and _is_imported(name, space, context)
    }
    hz = metadata.get("control_hz", context.hz)
    known = isinstance(hz, int | float) and math.isfinite(hz) and hz > 0.0
    if not known:
        context.note(f"The rate is unknown and taken to be {DEFAULT_HZ:g} Hz; --hz states it.")
    camera = next(iter(pictured.values()), None)
    header = EpisodeHeader(
        action_layout=_layout_of(acted, "action").to_json(),
        state_layout=_layout_of(sensed, "observation").to_json() if sensed else "",
        image_size=None if camera is None else _picture_size(camera),
        control_hz=float(cast("float", hz)) if known else DEFAULT_HZ,
        clock="none",
        source="minari",
        notes={"dataset": str(metadata.get("dataset_id", "")), "rate_is_known": known},
    )

    def places(leaves: dict[str, spaces.Space[Any]], part: str) -> list[tuple[str, int]]:
        return [
            (f"{part}/{name}" if name else part, max(1, math.prod(space.shape or ())))
            for name, space in leaves.items()
        ]

    return _Parts(
        header=header,
        action=places(acted, _ACTION),
        state=places(sensed, OBSERVATIONS),
        picture=next((name for name, _ in places(pictured, OBSERVATIONS)), ""),
        is_jpeg=bool(metadata.get("jpeg_encoding", True))
        and camera is not None
        and stored_as_jpeg(camera),
    )


def _rows(
    main: Path, number: int, steps: int, parts: _Parts, context: ImportContext
) -> Iterator[ExchangeStep]:
    """Yield the steps of an episode; those that cannot be read are left out."""
    pictures = Pictures(parts.header.image_size)
    group, done = f"episode_{number}", 0
    read, shown, jpeg, fault = -1, -1, b"", ""

    def leave_out(error: DemosError, left: range) -> None:
        why = str(error).removesuffix(".")
        for step in left:
            context.leave_out("step", f"that cannot be read ({why})", f"{step} of {group}")

    try:
        with open_hdf5(main) as file:
            columns = parts.columns(file, number)
            cut_off = bool(parts.infos) and bool(column(file, f"{group}/{CUT_OFF}", 1)[0])
            count = chunk_of(columns.values(), _CHUNK)
            for start in range(0, steps, count):
                part = slice(start, min(start + count, steps))
                chunk = {name: values[part] for name, values in columns.items()}
                actions = _flat(chunk, parts.action, main)
                states = _flat(chunk, parts.state, main)
                for place in range(part.stop - start):
                    at = {name: values[place] for name, values in chunk.items()}
                    done = start + place + 1
                    frame = int(at[FRAME]) if FRAME in at else done if parts.picture else shown
                    try:
                        if frame not in {read, shown}:
                            read, jpeg, fault = frame, b"", ""
                            try:
                                jpeg = _picture(at[parts.picture], parts, pictures)
                            except DemosError as error:
                                fault = str(error)
                        if frame == read and fault:  # Several steps may share it.
                            raise DemosError(fault)
                        action = tuple(actions[place].tolist())
                        if not np.isfinite(action).all():
                            raise DemosError("The action is not finite.")
                        row = _step(at, action, tuple(states[place].tolist()))
                    except DemosError as error:
                        leave_out(error, range(done - 1, done))
                        continue
                    if cut_off and done == steps:
                        row = replace(row, step=msgspec.structs.replace(row.step, truncated=False))
                    if frame != shown:
                        row, shown = replace(row, jpeg=jpeg), frame
                    yield row
    except DemosError as error:
        leave_out(error, range(done, steps))


def _flat(
    chunk: dict[str, Any], places: Sequence[tuple[str, int]], main: Path
) -> NDArray[np.float64]:
    """Return the values of some steps, shape (n, number of all values)."""
    steps = len(chunk[_TERMINATED])
    flat = [np.empty((steps, 0))]
    for name, size in places:
        try:
            numbers = np.asarray(chunk[name], np.float64).reshape(steps, -1)
        except (ValueError, TypeError) as error:
            raise DemosError(f"{main}: {name!r} is not numeric ({error}).") from error
        if numbers.shape[1] != size:
            raise DemosError(
                f"{main}: {name!r} has {numbers.shape[1]} values per step, but its space {size}."
            )
        flat.append(numbers)
    return np.concatenate(flat, axis=1)


def _picture(stored: Any, parts: _Parts, pictures: Pictures) -> bytes:
    """Return a picture as JPEG."""
    if parts.is_jpeg:
        pictures.check(bytes(stored), "in the file")
        return bytes(stored)
    pixels = np.asarray(stored)
    if pixels.ndim == 2:
        pixels = pixels[..., None]
    elif pixels.ndim == 3 and _colours_first(pixels.shape):
        pixels = np.moveaxis(pixels, 0, -1)
    size = parts.header.image_size
    if pixels.dtype != np.uint8 or pixels.ndim != 3 or pixels.shape[1::-1] != size:
        raise DemosError("The picture does not fit its space.")
    return encode_picture(np.repeat(pixels, 3, -1) if pixels.shape[-1] == 1 else pixels)


def _step(at: dict[str, Any], action: tuple[float, ...], state: tuple[float, ...]) -> ExchangeStep:
    """Return a step, without its picture; the infos of others are not known."""
    reward = float(at[_REWARD]) if _REWARD in at else math.nan
    fields: dict[str, Any] = {
        "driver": "expert",
        "reward": None if math.isnan(reward) else reward,
        "terminated": bool(at[_TERMINATED]),
        "truncated": bool(at[_TRUNCATED]),
    }
    marks, dropped = (), None
    if _MORE in at:
        try:
            more = json.loads(at[_MORE])
            fields["driver"] = at[_DRIVER].decode()
            times = {name: int(at[f"infos/{name}"]) for name in _TIMES}
            fields |= {name: ns for name, ns in times.items() if ns != UNKNOWN_NS}
            for name in ("applied", "wanted"):
                if at[f"infos/has_{name}"]:
                    fields[name] = tuple(at[f"infos/{name}"].tolist())
            fields["reward"] = reward if at["infos/rewarded"] else None
            fields["terms"] = {name: float(v) for name, v in more.get("terms", {}).items()}
            fields["stop_reason"] = str(more.get("stop_reason", at[_STOP].decode()))
            marks = tuple(map(str, more.get("marks", ())))
            dropped = None if more.get("dropped") is None else str(more["dropped"])
        except (ValueError, TypeError, AttributeError, LookupError) as error:
            raise DemosError(f"The infos cannot be read: {error}.") from error
    if fields["driver"] not in DRIVERS:
        raise DemosError(str(UnknownName("driver", fields["driver"], DRIVERS)))
    step = Step(action=action, state=state, **fields)
    return ExchangeStep(step=step, jpeg=None, marks=marks, dropped=dropped)


def _leaves_in(metadata: dict[str, Any], name: str, path: Path) -> dict[str, spaces.Space[Any]]:
    """Return the spaces without subspaces in a space of the metadata, by their paths there."""
    text = metadata.get(name)
    if not isinstance(text, str):
        raise DemosError(
            f"{path} has no {name}, so its values cannot be interpreted: create the dataset again "
            "with this space."
        )
    if _largest(parse_json(text, f"The {name} in {path}")) > MAX_UNPACKED:
        raise DemosError(f"The {name} in {path} claims more than {MAX_UNPACKED} values.")
    try:
        return dict(_leaves(library("minari.serialization").deserialize_space(text)))
    except MissingExtra:
        raise
    except Exception as error:  # Its errors for invalid text are not documented.
        raise DemosError(f"The {name} in {path} cannot be read: {error}.") from error


def _largest(space: Any) -> int:
    """Return the number of values that the shapes in the JSON of a space claim."""
    if isinstance(space, list):
        return sum(map(_largest, cast("list[Any]", space)))
    if not isinstance(space, dict):
        return 0
    fields = cast("dict[str, Any]", space)
    shape = cast("list[Any]", s) if isinstance(s := fields.get("shape"), list) else []
    own = math.prod(n for n in shape if isinstance(n, int))
    return own + sum(_largest(value) for key, value in fields.items() if key != "shape")


def _leaves(space: spaces.Space[Any], path: str = "") -> Iterator[tuple[str, spaces.Space[Any]]]:
    """Yield the leaves of a tree of spaces, in the order and with the keys of Minari's files."""
    parts: dict[str, spaces.Space[Any]] = {}
    if isinstance(space, spaces.Dict):
        parts = cast("Any", space).spaces
    elif isinstance(space, spaces.Tuple):
        parts = {f"_index_{n}": inner for n, inner in enumerate(cast("Any", space).spaces)}
    else:
        yield path, space
    for key, inner in parts.items():
        yield from _leaves(inner, f"{path}/{key}" if path else key)


def _is_imported(name: str, space: spaces.Space[Any], context: ImportContext) -> bool:
    """Return whether a part of an observation is numbers; others are reported."""
    shape, about = space.shape or (), f"{name or 'the observation'} ({space})"
    numbers = spaces.Box | spaces.Discrete | spaces.MultiDiscrete | spaces.MultiBinary
    deep = isinstance(space, spaces.Box) and cast("Any", space).dtype in _DEEP
    if not isinstance(space, numbers):
        context.note(f"The observation {about} is not imported.")
    elif deep and len(shape) in {2, 3} and min(shape[:2]) >= _MIN_PICTURE:
        context.leave_out("observation", "with pictures of an unknown kind or of depth", about)
    elif math.prod(shape) > MAX_VALUES:
        context.leave_out("observation", f"of more than {MAX_VALUES} values", about)
    else:
        return True
    return False


def _layout_of(leaves: dict[str, spaces.Space[Any]], what: str) -> Layout:
    """Return a layout for the values of leaves, of an "action" or "observation", in order."""
    features: list[Feature] = []
    for name, space in leaves.items():
        match space:
            case spaces.Box():
                low, high = space.low, space.high
            case spaces.Discrete():
                low, high = space.start, space.start + space.n - 1
            case spaces.MultiDiscrete():
                low, high = space.start, space.start + space.nvec - 1
            case spaces.MultiBinary():
                low, high = np.zeros(space.shape), np.ones(space.shape)
            case _:
                raise DemosError(
                    f"The {what} has {name or 'a space'!r} of the type {type(space).__name__}, "
                    "which cannot be imported: use Box, Discrete, MultiDiscrete or MultiBinary."
                )
        lows, highs = (np.ravel(np.asarray(end, np.float64)).tolist() for end in (low, high))
        if not lows:
            raise DemosError(f"The {what} has {name or 'a space'!r} without any values.")
        if len(lows) > MAX_FEATURES:
            shape = (len(lows),)
            features.append(Feature(name or what, UNIT_UNKNOWN, min(lows), max(highs), shape=shape))
            continue
        for number, (least, most) in enumerate(zip(lows, highs, strict=True)):
            numbered = (name or what) + ("" if len(lows) == 1 else f"/{number}")
            features.append(Feature(numbered, UNIT_UNKNOWN, least, most))
    return Layout(tuple(features))


def _picture_size(space: spaces.Space[Any]) -> tuple[int, int] | None:
    """Return the width and height of the pictures of a space; None if it has no pictures."""
    shape = space.shape or ()
    if not isinstance(space, spaces.Box) or cast("Any", space).dtype != np.uint8:
        return None
    if len(shape) == 3 and _colours_first(shape):
        shape = shape[1:]
    elif len(shape) != 2 and (len(shape) != 3 or shape[2] not in _CHANNELS):
        return None
    height, width = shape[:2]
    if height * width > MAX_PIXELS:
        raise DemosError(
            f"The pictures of the dataset have {width} x {height} pixels, more than the limit of "
            f"{MAX_PIXELS}: make them smaller."
        )
    return (width, height) if min(height, width) >= _MIN_PICTURE else None


def _colours_first(shape: tuple[int, ...]) -> bool:
    """Return whether the first of three axes is that of the colours."""
    return shape[0] in _CHANNELS and shape[2] not in _CHANNELS


FORMAT: Final = Format(
    name="minari",
    title="Minari",
    sign=f"{DATA}/{METADATA}",
    detect=lambda folder: _data_folder(folder) is not None,
    read=read_minari,
    write=write_minari,
    options=frozenset({"hz", "dropped"}),
    consecutive=True,
)
