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

Minari's own writer (`MinariStorage.update_episodes`) is not used for the steps: it decodes and
encodes each picture again at JPEG quality 75, and needs the whole episode in memory.

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
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.episodes import DRIVERS, EpisodeHeader, Step
from shapechanger.demos.exchange.columns import fields_of, name_in
from shapechanger.demos.exchange.files import (
    chunk_of,
    column,
    inside,
    names_in,
    open_hdf5,
    own_headers,
    read_json_object,
)
from shapechanger.demos.exchange.format import (
    DEFAULT_HZ,
    ExchangeEpisode,
    ExchangeStep,
    Format,
    ImportContext,
    few,
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
    write_minari,
)
from shapechanger.demos.exchange.minari_spaces import (
    Leaf,
    colours_first,
    is_imported,
    layout_of,
    picture_size,
    read_leaves,
    stored_as_jpeg,
)
from shapechanger.demos.exchange.pictures import Pictures
from shapechanger.demos.jpeg import encode_picture
from shapechanger.errors import DemosError, UnknownName

_CHUNK: Final = 64  # Steps in memory at once; pictures may be stored as pixels.
_TIMES: Final = fields_of("time")
_ACTION, _REWARD, _TERMINATED, _TRUNCATED, _DRIVER, _STOP, _MORE = (
    name_in("minari", field)
    for field in ("action", "reward", "terminated", "truncated", "driver", "stop_reason", "terms")
)
_APPLIED, _WANTED = (name_in("minari", field) for field in ("applied", "wanted"))
_INFOS: Final = (
    *(f"infos/{name}" for name in ("rewarded", "has_applied", "has_wanted", *_TIMES)),
    *(_APPLIED, _WANTED, _DRIVER, _STOP, _MORE),
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
    ours = own_headers(metadata[OURS], path) if OURS in metadata else None
    if ours is not None and len(ours) != count:
        raise DemosError(
            f"{path} has the headers of {len(ours)} episodes, but total_episodes is {count}."
        )
    theirs = _foreign(main, path, metadata, context) if ours is None else None
    for number in range(count):
        try:
            with open_hdf5(main) as file:
                parts = theirs or _own(file, number, (ours or [])[number])
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
    if ours is None:
        _report_more(main, count, context)


def _require_stored(main: Path, count: int) -> None:
    """Refuse a file that claims more steps than it has bytes.

    HDF5 stores empty arrays of any size in no bytes, and one array under any number of names.
    """
    size = main.stat().st_size
    claimed = 0
    with open_hdf5(main) as file:
        for number in range(count):
            for name in (_REWARD, _TERMINATED, _TRUNCATED):
                with suppress(DemosError):  # It is left out later.
                    claimed += int(column(file, f"episode_{number}/{name}").shape[0])
            if claimed > size:
                raise DemosError(f"{main} claims at least {claimed} values, but has {size} bytes.")


@dataclass(frozen=True, slots=True)
class _Parts:
    """Where the parts of a step are in the group of an episode.

    Attributes:
        header: Header of the episode.
        action: Columns of the action, each with its number of values.
        state: Those of the state.
        picture: Column of the picture; "" without one.
        is_jpeg: Whether that holds JPEGs, or pixels.
        infos: Columns of our own; () in a dataset of others.
    """

    header: EpisodeHeader
    action: Sequence[tuple[str, int]]
    state: Sequence[tuple[str, int]]
    picture: str
    is_jpeg: bool
    infos: Sequence[str] = ()

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
    both = pictured and bool(header.state_layout)
    state = name_in("minari", "state") if both else OBSERVATIONS
    picture = name_in("minari", "frame") if both else OBSERVATIONS
    if "jpeg" in infos:
        picture = JPEG
    return _Parts(
        header=header,
        action=[(_ACTION, header.action_size)],
        state=[(state, header.state_size)] if header.state_layout else [],
        picture=picture if pictured else "",
        is_jpeg=True,
        infos=(*_INFOS, FRAME) if pictured else _INFOS,
    )


def _foreign(main: Path, path: Path, metadata: dict[str, Any], context: ImportContext) -> _Parts:
    """Return where the parts of the episodes of a dataset of others are."""
    observed = read_leaves(metadata, "observation_space", path)
    acted = read_leaves(metadata, "action_space", path)
    pictured = [leaf for leaf in observed if picture_size(leaf.space)]
    if len(pictured) > 1:
        raise DemosError(
            f"An observation in {main} has {len(pictured)} pictures "
            f"({', '.join(leaf.name for leaf in pictured)}), but an episode has one camera: keep "
            "one of them in the dataset."
        )
    sensed = [leaf for leaf in observed if leaf not in pictured and is_imported(leaf, context)]
    hz = metadata.get("control_hz", context.hz)
    known = isinstance(hz, int | float) and math.isfinite(hz) and hz > 0.0
    if not known:
        context.note(f"The rate is unknown and taken to be {DEFAULT_HZ:g} Hz; --hz states it.")
    header = EpisodeHeader(
        action_layout=layout_of(acted, "action").to_json(),
        state_layout=layout_of(sensed, "observation").to_json() if sensed else "",
        image_size=picture_size(pictured[0].space) if pictured else None,
        control_hz=float(hz) if isinstance(hz, int | float) and known else DEFAULT_HZ,
        clock="none",
        source="minari",
        notes={"dataset": str(metadata.get("dataset_id", "")), "rate_is_known": known},
    )

    def places(leaves: Sequence[Leaf], part: str) -> list[tuple[str, int]]:
        sizes = [max(1, math.prod(leaf.space.shape or ())) for leaf in leaves]
        names = ["/".join((part, *leaf.path)) for leaf in leaves]
        return list(zip(names, sizes, strict=True))

    jpeg = bool(metadata.get("jpeg_encoding", True))
    return _Parts(
        header=header,
        action=places(acted, _ACTION),
        state=places(sensed, OBSERVATIONS),
        picture=next((name for name, _ in places(pictured, OBSERVATIONS)), ""),
        is_jpeg=jpeg and bool(pictured) and stored_as_jpeg(pictured[0].space),
    )


def _report_more(main: Path, count: int, context: ImportContext) -> None:
    """Report totals that contradict the file, and what is never imported."""
    with open_hdf5(main) as file:
        groups = [name for name in names_in(file) if name.startswith("episode_")]
        if len(groups) != count:
            context.warn(f"total_episodes is {count}, and {main.name} has {len(groups)} episodes.")
        more = {name for group in groups for name in names_in(file, group, "infos")}
        if more:
            context.note(f"The infos are not imported: {few(sorted(more))}.")


def _rows(
    main: Path, number: int, steps: int, parts: _Parts, context: ImportContext
) -> Iterator[ExchangeStep]:
    """Yield the steps of an episode; those that cannot be read are left out."""
    pictures = Pictures(parts.header.image_size)
    group, done = f"episode_{number}", 0
    read, shown, jpeg, fault = -1, -1, b"", ""
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
                        _leave_out(context, error, range(done - 1, done), group)
                        continue
                    if cut_off and done == steps:
                        row = replace(row, step=replace(row.step, truncated=False))
                    if frame != shown:
                        row, shown = replace(row, jpeg=jpeg), frame
                    yield row
    except DemosError as error:
        _leave_out(context, error, range(done, steps), group)


def _leave_out(context: ImportContext, error: DemosError, steps: range, group: str) -> None:
    """Report steps that cannot be read, and why."""
    why = str(error).removesuffix(".")
    for step in steps:
        context.leave_out("step", f"that cannot be read ({why})", f"{step} of {group}")


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
                f"{main}: {name!r} has {numbers.shape[1]} values per step, but its space has "
                f"{size}."
            )
        flat.append(numbers[:steps])
    return np.concatenate(flat, axis=1)


def _picture(stored: Any, parts: _Parts, pictures: Pictures) -> bytes:
    """Return a picture as JPEG."""
    if parts.is_jpeg:
        pictures.check(bytes(stored), "in the file")
        return bytes(stored)
    pixels = np.asarray(stored)
    if pixels.ndim == 2:
        pixels = pixels[..., None]
    elif pixels.ndim == 3 and colours_first(pixels.shape):
        pixels = np.moveaxis(pixels, 0, -1)
    size = parts.header.image_size
    if pixels.dtype != np.uint8 or pixels.ndim != 3 or pixels.shape[1::-1] != size:
        raise DemosError("The picture does not fit its space.")
    return encode_picture(np.repeat(pixels, 3, -1) if pixels.shape[-1] == 1 else pixels)


def _step(at: dict[str, Any], action: tuple[float, ...], state: tuple[float, ...]) -> ExchangeStep:
    """Return a step, without its picture; the infos of others are not known."""
    reward = float(at[_REWARD]) if _REWARD in at else math.nan
    step = Step(
        action=action,
        driver="expert",
        state=state,
        reward=None if math.isnan(reward) else reward,
        terminated=bool(at[_TERMINATED]),
        truncated=bool(at[_TRUNCATED]),
    )
    if _MORE not in at:
        return ExchangeStep(step=step, jpeg=None)
    try:
        more = json.loads(at[_MORE])
        driver = at[_DRIVER].decode()
        known = {name: int(at[f"infos/{name}"]) for name in _TIMES}
        actions = {
            name: tuple(at[f"infos/{name}"].tolist()) if at[f"infos/has_{name}"] else None
            for name in ("applied", "wanted")
        }
        fields: dict[str, Any] = {n: ns for n, ns in known.items() if ns != UNKNOWN_NS} | actions
        fields["reward"] = reward if at["infos/rewarded"] else None
        fields["terms"] = {name: float(value) for name, value in more.get("terms", {}).items()}
        fields["stop_reason"] = str(more.get("stop_reason", at[_STOP].decode()))
        marks = tuple(map(str, more.get("marks", ())))
        dropped = more.get("dropped")
    except (ValueError, TypeError, AttributeError, LookupError) as error:
        raise DemosError(f"The infos cannot be read: {error}.") from error
    if driver not in DRIVERS:
        raise DemosError(str(UnknownName("driver", driver, DRIVERS)))
    step = replace(step, driver=driver, **fields)
    dropped = None if dropped is None else str(dropped)
    return ExchangeStep(step=step, jpeg=None, marks=marks, dropped=dropped)


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
