"""Import of Minari datasets: exact for our own, and as far as possible for those of others.

Of a foreign dataset, at most one part of an observation may be a picture; all other values become
the state, in order, and those of an action the action. Units are unknown and written "?". Pictures
that Minari stores as JPEG are kept; others are encoded as JPEG of quality 100, which changes them
slightly. The driver is unknown and taken to be an "expert". The rate is that of the key
`control_hz`, that of `--hz`, or 20 Hz.

Neither Minari's own folder nor the network is used, and no external HDF5 link is followed.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.episodes import DRIVERS, EpisodeHeader, Step
from shapechanger.demos.exchange import minari_export as names
from shapechanger.demos.exchange.files import (
    Pictures,
    parse_json_object,
    read_text,
    resolve_file,
)
from shapechanger.demos.exchange.importing import ImportContext, few
from shapechanger.demos.exchange.minari_export import stored_as_jpeg
from shapechanger.demos.exchange.minari_files import chunk_of, column, infos_of, open_hdf5
from shapechanger.demos.exchange.minari_spaces import (
    Leaf,
    colours_first,
    is_imported,
    layout_of,
    leaves_of,
    picture_size,
    read_space,
)
from shapechanger.demos.exchange.recorded import DEFAULT_HZ, ExchangeEpisode, ExchangeStep
from shapechanger.demos.jpeg import encode_picture
from shapechanger.errors import DemosError, UnknownName

_OWN_CHUNK: Final = 256  # Steps in memory at once.
_FOREIGN_CHUNK: Final = 64  # Fewer, because pictures may be stored as pixels.
_OWN_COLUMNS: Final = (
    "actions",
    "rewards",
    "terminations",
    "truncations",
    "infos/rewarded",
    "infos/applied",
    "infos/has_applied",
    "infos/wanted",
    "infos/has_wanted",
    *(f"infos/{name}" for name in names.TIMES),
    "infos/driver",
    "infos/stop_reason",
    "infos/more",
)
_CUT_OFF: Final = "infos/cut_off"
_ENDS: Final = ("terminations", "truncations")


def read_minari(folder: Path, context: ImportContext) -> Iterator[ExchangeEpisode]:
    """Yield the episodes of a dataset.

    Args:
        folder: Folder of the dataset.
        context: Its `hz` applies where the metadata has no `control_hz`.

    Raises:
        DemosError: If something is damaged or missing, or a space cannot be imported.
        MissingExtra: If Minari or h5py is not installed.
    """
    place = names.data_folder(folder)
    if place is None:
        raise DemosError(f"There is no Minari dataset in {folder}: it needs {names.METADATA}.")
    path = place / names.METADATA
    metadata = parse_json_object(read_text(path), str(path))
    if metadata.get("data_format", "hdf5") != "hdf5":
        raise DemosError(
            f"{folder} is stored as {metadata['data_format']!r}, but only 'hdf5' is supported: "
            "create it with data_format='hdf5'."
        )
    main = resolve_file(place, names.MAIN, str(path))
    count = metadata.get("total_episodes")
    if not isinstance(count, int) or isinstance(count, bool) or count < 1:
        raise DemosError(f"{path}: total_episodes must be a positive integer, got {count!r}.")
    _require_stored(main, count)
    if names.HEADERS in metadata:
        yield from _read_own(main, path, metadata[names.HEADERS], count, context)
    else:
        yield from _read_foreign(main, path, metadata, count, context)


def _require_stored(main: Path, count: int) -> None:
    """Refuse a file that claims more steps than it has bytes.

    HDF5 stores empty arrays of any size in no bytes, and one array under any number of names.

    Args:
        main: The HDF5 file.
        count: Number of episodes.
    """
    size = main.stat().st_size
    claimed = 0
    with open_hdf5(main) as file:
        for number in range(count):
            for name in ("rewards", *_ENDS):
                with suppress(DemosError):  # It is left out later.
                    claimed += int(column(file, f"episode_{number}/{name}", main, 0).shape[0])
            if claimed > size:
                raise DemosError(f"{main} claims at least {claimed} values, but has {size} bytes.")


def _whole(
    main: Path, count: int, context: ImportContext, check: Callable[[Any, int], None]
) -> Iterator[int]:
    """Yield the numbers of the episodes that pass a check; the others are left out.

    Args:
        main: The HDF5 file.
        count: Number of episodes.
        context: Findings of the import.
        check: Raises a `DemosError` for the open file and the number of an episode.
    """
    for number in range(count):
        try:
            with open_hdf5(main) as file:
                check(file, number)
        except DemosError as error:
            why = str(error).removesuffix(".")
            context.leave_out("episode", f"that cannot be read ({why})", number)
        else:
            yield number


def _read_own(
    main: Path, path: Path, section: object, count: int, context: ImportContext
) -> Iterator[ExchangeEpisode]:
    """Yield the episodes of a dataset exported by Shapechanger.

    Args:
        main: The HDF5 file.
        path: The metadata file, for errors.
        section: Shapechanger's section of the metadata.
        count: Number of episodes.
        context: Findings of the import.
    """
    fields = cast("dict[str, Any]", section) if isinstance(section, dict) else {}
    headers = fields.get("episodes")
    if fields.get("format") != names.HEADERS_FORMAT or not isinstance(headers, list):
        raise DemosError(
            f"{path} was written by another version of Shapechanger: this one reads format "
            f"{names.HEADERS_FORMAT} only."
        )
    plain = cast("list[dict[str, Any]]", headers)
    if len(plain) != count:
        raise DemosError(
            f"{path} has the headers of {len(plain)} episodes, but total_episodes is {count}."
        )

    def check(file: Any, number: int) -> None:
        header = EpisodeHeader.from_json(plain[number])
        _own_columns(file, f"episode_{number}", header, main)

    for number in _whole(main, count, context, check):
        header = plain[number]
        known = EpisodeHeader.from_json(header)
        yield ExchangeEpisode(
            header=known,
            rows=_own_rows(main, number, known, context),
            name=f"{path}, episode {number}",
            outcome=str(header.get("outcome", "")),
        )


def _own_columns(
    file: Any, group: str, header: EpisodeHeader, main: Path
) -> tuple[dict[str, Any], int]:
    """Return the columns of an own episode by name, and its number of steps."""
    steps = int(column(file, f"{group}/rewards", main).shape[0])
    places = {name: name for name in _OWN_COLUMNS} | _observed(file, group, header)
    columns = {name: column(file, f"{group}/{at}", main, steps) for name, at in places.items()}
    columns[_CUT_OFF] = column(file, f"{group}/{_CUT_OFF}", main, 1)
    return columns, steps


def _own_rows(
    main: Path, number: int, header: EpisodeHeader, context: ImportContext
) -> Iterator[ExchangeStep]:
    pictures = Pictures(header.image_size)
    group, done, steps = f"episode_{number}", 0, 0
    read, jpeg, shown = -1, b"", -1
    try:
        with open_hdf5(main) as file:
            columns, steps = _own_columns(file, group, header, main)
            cut_off = bool(columns.pop(_CUT_OFF)[0])
            count = chunk_of(columns.values(), _OWN_CHUNK)
            for start in range(0, steps, count):
                chunk = {name: values[start : start + count] for name, values in columns.items()}
                for place in range(min(count, steps - start)):
                    at = {name: values[place] for name, values in chunk.items()}
                    done = start + place + 1
                    frame = int(at["infos/frame"]) if "infos/frame" in at else shown
                    try:
                        row = _own_step(at, f"{main}, step {done - 1} of {group}")
                        if frame not in (read, shown):
                            read, jpeg = frame, b""
                            pictures.check(bytes(at[names.JPEG]), "in the file")
                            jpeg = bytes(at[names.JPEG])
                        elif frame != shown and not jpeg:
                            raise DemosError("The picture, that of the step before, is damaged.")
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


def _observed(file: Any, group: str, header: EpisodeHeader) -> dict[str, str]:
    """Return the places of the picture and the state in the file."""
    pictured = f"{group}/infos/frame" in file
    has_state = bool(header.state_layout)
    places: dict[str, str] = {}
    if has_state:
        places[names.STATE] = f"observations/{names.STATE}" if pictured else "observations"
    if pictured:
        beside = f"infos/{names.JPEG}"
        inside = f"observations/{names.IMAGE}" if has_state else "observations"
        places[names.JPEG] = beside if f"{group}/{beside}" in file else inside
        places["infos/frame"] = "infos/frame"
    return places


def _own_step(at: dict[str, Any], where: str) -> ExchangeStep:
    """Return a step, without its picture."""
    try:
        more = json.loads(at["infos/more"])
        driver = at["infos/driver"].decode()
        known = {name: int(at[f"infos/{name}"]) for name in names.TIMES}
        times_ns: dict[str, Any] = {n: ns for n, ns in known.items() if ns != names.UNKNOWN_NS}
        step = Step(
            action=_vector(at["actions"]),
            driver=driver,
            applied=_vector(at["infos/applied"]) if at["infos/has_applied"] else None,
            wanted=_vector(at["infos/wanted"]) if at["infos/has_wanted"] else None,
            state=_vector(at[names.STATE]) if names.STATE in at else (),
            **times_ns,
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
    return ExchangeStep(
        step=step, jpeg=None, marks=marks, dropped=None if dropped is None else str(dropped)
    )


def _vector(values: Any) -> tuple[float, ...]:
    return tuple(float(value) for value in values)


def _read_foreign(
    main: Path, path: Path, metadata: dict[str, Any], count: int, context: ImportContext
) -> Iterator[ExchangeEpisode]:
    """Yield the episodes of a dataset of others.

    Args:
        main: The HDF5 file.
        path: The metadata file, for errors.
        metadata: Its content.
        count: Number of episodes.
        context: Options and findings of the import.
    """
    observed = list(leaves_of(read_space(metadata, "observation_space", path)))
    acted = list(leaves_of(read_space(metadata, "action_space", path)))
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
    jpeg = bool(metadata.get("jpeg_encoding", True))
    as_jpeg = jpeg and bool(pictured) and stored_as_jpeg(pictured[0].space)
    leaves = _Leaves(acted, sensed, pictured, as_jpeg, header.image_size)
    for number in _whole(
        main, count, context, lambda file, n: leaves.check(file, n, main, context)
    ):
        yield ExchangeEpisode(
            header=header,
            rows=_foreign_rows(main, number, leaves, context),
            name=f"{main}, episode_{number}",
        )
    _report_more(main, metadata, count, context)


def _report_more(main: Path, metadata: dict[str, Any], count: int, context: ImportContext) -> None:
    """Report totals that contradict the file, and what is never imported."""
    with open_hdf5(main) as file:
        groups = [str(name) for name in file if str(name).startswith("episode_")]
        if len(groups) != count:
            context.warn(f"total_episodes is {count}, and {main.name} has {len(groups)} episodes.")
        more = {name for group in groups for name in infos_of(file, group)}
        if more:
            context.note(f"The infos are not imported: {few(sorted(more))}.")


@dataclass(frozen=True, slots=True)
class _Leaves:
    """What is imported of a dataset of others.

    Attributes:
        acted: Parts of the action.
        sensed: Parts of the observation that become the state.
        pictured: The part of it that is a picture, if any.
        as_jpeg: Whether that is stored as JPEG.
        size: Width and height of the pictures, pixels; None without any.
    """

    acted: Sequence[Leaf]
    sensed: Sequence[Leaf]
    pictured: Sequence[Leaf]
    as_jpeg: bool
    size: tuple[int, int] | None

    def columns(self, file: Any, number: int, main: Path) -> tuple[list[Any], list[Any], list[Any]]:
        """Return the columns of the action, of the state and of the picture."""
        group = f"episode_{number}"

        def of(leaves: Sequence[Leaf], part: str) -> list[Any]:
            return [column(file, "/".join((group, part, *leaf.path)), main) for leaf in leaves]

        seen = "observations"
        return of(self.acted, "actions"), of(self.sensed, seen), of(self.pictured, seen)

    def check(self, file: Any, number: int, main: Path, context: ImportContext) -> None:
        """Refuse an episode whose columns have different lengths.

        Raises:
            DemosError: If they have, or one is missing.
        """
        group = f"episode_{number}"
        ends = [column(file, f"{group}/{name}", main) for name in _ENDS]
        acted, sensed, pictured = self.columns(file, number, main)
        steps = int(ends[0].shape[0])
        exact = [*ends, *acted]
        if "rewards" in file[group]:
            exact.append(column(file, f"{group}/rewards", main))
        else:
            context.warn(f"{main.name} has no rewards: the steps have none.")
        for one in exact:
            if one.shape[0] != steps:
                raise DemosError(
                    f"{one.name!r} has {one.shape[0]} entries, but {ends[0].name!r} {steps}"
                )
        for one in (*sensed, *pictured):  # The last observation follows the last step.
            if one.shape[0] not in {steps, steps + 1}:
                raise DemosError(
                    f"{one.name!r} has {one.shape[0]} entries, but {steps + 1} are needed"
                )
        stated = file[group].attrs.get("total_steps", steps)
        if not np.array_equal(np.ravel(stated), [steps]):
            raise DemosError(f"{group} has {steps} steps, and its total_steps says {stated}")


def _foreign_rows(
    main: Path, number: int, leaves: _Leaves, context: ImportContext
) -> Iterator[ExchangeStep]:
    pictures = Pictures(leaves.size)
    group, done, steps = f"episode_{number}", 0, 0
    try:
        with open_hdf5(main) as file:
            action, state, frames = leaves.columns(file, number, main)
            ends = [column(file, f"{group}/{name}", main) for name in _ENDS]
            steps = int(ends[0].shape[0])
            known = "rewards" in file[group]
            rewards = column(file, f"{group}/rewards", main) if known else None
            count = chunk_of((*action, *state, *frames, *ends), _FOREIGN_CHUNK)
            for start in range(0, steps, count):
                part = slice(start, min(start + count, steps))
                actions = _flat(action, leaves.acted, part, main)
                states = _flat(state, leaves.sensed, part, main)
                worth = [math.nan] * count if rewards is None else rewards[part]
                over, cut = ends[0][part], ends[1][part]
                seen = frames[0][part] if frames else None
                for place in range(part.stop - start):
                    done = start + place + 1
                    try:
                        jpeg = None
                        if seen is not None and leaves.as_jpeg:
                            jpeg = bytes(seen[place])
                            pictures.check(jpeg, "in the file")
                        elif seen is not None:
                            jpeg = _encoded(np.asarray(seen[place]), leaves.size)
                        if not np.isfinite(actions[place]).all():
                            raise DemosError("The action is not finite.")
                    except DemosError as error:
                        _leave_out(context, error, range(done - 1, done), group)
                        continue
                    reward = float(worth[place])
                    step = Step(
                        action=tuple(actions[place].tolist()),
                        driver="expert",
                        state=tuple(states[place].tolist()),
                        reward=None if math.isnan(reward) else reward,
                        terminated=bool(over[place]),
                        truncated=bool(cut[place]),
                    )
                    yield ExchangeStep(step=step, jpeg=jpeg)
    except DemosError as error:
        _leave_out(context, error, range(done, steps), group)


def _flat(
    columns: Sequence[Any], leaves: Sequence[Leaf], part: slice, main: Path
) -> NDArray[np.float64]:
    """Return the values of some steps, shape (n, size of all leaves)."""
    steps = part.stop - part.start
    flat = [np.empty((steps, 0))]
    for values, leaf in zip(columns, leaves, strict=True):
        try:
            numbers = np.asarray(values[part], np.float64).reshape(steps, -1)
        except (ValueError, TypeError) as error:
            raise DemosError(f"{main}: {values.name!r} is not numeric ({error}).") from error
        size = max(1, math.prod(leaf.space.shape or ()))
        if numbers.shape[1] != size:
            raise DemosError(
                f"{main}: {values.name!r} has {numbers.shape[1]} values per step, but its space "
                f"has {size}."
            )
        flat.append(numbers)
    return np.concatenate(flat, axis=1)


def _encoded(pixels: NDArray[Any], size: tuple[int, int] | None) -> bytes:
    """Return a picture as JPEG."""
    if pixels.ndim == 2:
        pixels = pixels[..., None]
    elif pixels.ndim == 3 and colours_first(pixels.shape):
        pixels = np.moveaxis(pixels, 0, -1)
    if pixels.dtype != np.uint8 or pixels.ndim != 3 or pixels.shape[1::-1] != size:
        raise DemosError("The picture does not fit its space.")
    return encode_picture(np.repeat(pixels, 3, -1) if pixels.shape[-1] == 1 else pixels)
