"""Minari datasets: ours without a loss, and those of others as far as possible.

An observation is the image, the state, or a dictionary of both. An image is stored as the JPEG
that was recorded, which Minari decodes on reading; it is not encoded again. Images below 32
pixels, which Minari does not store as JPEG, are stored as pixels, with the JPEG in `infos/jpeg`.
Minari needs one observation more than there are steps, so the last one is repeated.

Of the infos of a step, `frame` is the index of the image in the episode, the same for steps that
share one, and `step` is everything without a column of its own, as JSON. The reward is NaN where
it is unknown. The headers of the episodes, the layouts and the rate are in `metadata.json`.

Of a dataset of others, at most one part of an observation may be an image; all other values become
the state, in order. Images that are not JPEG are encoded with quality 100. The driver is unknown
and taken to be an "expert". The rate is the key `control_hz`, `--hz`, or 20 Hz.

Minari's own writer (`MinariStorage.update_episodes`) is not used for the steps: it decodes and
encodes each image again at JPEG quality 75, and needs the whole episode in memory.
"""

from __future__ import annotations

import copy
import json
import math
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from itertools import chain
from pathlib import Path
from typing import Any, Final, cast

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from shapechanger.demos.episodes import EpisodeHeader, Step
from shapechanger.demos.exchange import files, imports, minari_spaces
from shapechanger.demos.exchange.format import (
    DEFAULT_HZ,
    ExchangeEpisode,
    ExchangeStep,
    ExportContext,
    Format,
    ImportContext,
    decoded_steps,
    few,
    name_in,
)
from shapechanger.demos.exchange.imports import SourceRecord
from shapechanger.demos.jpeg import is_grey
from shapechanger.errors import DemosError

_DATA: Final = "data"
_METADATA: Final = "metadata.json"
_MAIN: Final = "main_data.hdf5"
_OURS: Final = "shapechanger"  # Key of our own section in `metadata.json`.
_FRAME, _JPEG = "infos/frame", "infos/jpeg"
_OBSERVATIONS: Final = "observations"
_ACTION, _STATE, _PICTURE, _REWARD, _TERMINATED, _TRUNCATED, _STEP = (
    name_in("minari", field)
    for field in ("action", "state", "frame", "reward", "terminated", "truncated", "driver")
)
_IN_COLUMNS: Final = ("kind", "action", "state", "frame")  # Keys of a step that its JSON lacks.
_STORAGE: Final = "minari.dataset.minari_storage"
_NAME: Final = re.compile(r"[\w-]+-v[0-9]+")
_CHUNK: Final = 64  # Steps in memory at once; images may be stored as pixels.


def _data_folder(folder: Path) -> Path | None:
    """Return the folder with the files of a dataset: `data`, or `folder` itself; None for none."""
    return next((p for p in (folder / _DATA, folder) if (p / _METADATA).is_file()), None)


def _read(folder: Path, context: ImportContext) -> Iterator[ExchangeEpisode]:
    place = _data_folder(folder) or folder
    path = place / _METADATA
    metadata = files.read_json_object(path)
    if metadata.get("data_format", "hdf5") != "hdf5":
        raise DemosError(
            f"{folder} is stored as {metadata['data_format']!r}, but only 'hdf5' is supported: "
            "create it with data_format='hdf5'."
        )
    main = files.inside(place, _MAIN, path)
    count, most, claimed = metadata.get("total_episodes"), main.stat().st_size, 0
    if not isinstance(count, int) or isinstance(count, bool) or not 1 <= count <= most:
        raise DemosError(f"{path}: total_episodes must be a positive integer, got {count!r}.")
    ours = files.own_episodes(metadata[_OURS], path, count) if _OURS in metadata else []
    theirs = None if ours else _foreign(main, path, metadata, context)
    for number in range(count):
        try:
            header, outcome = files.own_header(ours[number], path) if ours else (None, "")
            with files.open_hdf5(main) as file:
                parts = theirs if header is None else _own(file, number, header)
                assert parts is not None
                steps = parts.count_steps(file, number, context)
        except DemosError as error:
            context.leave_out("episode", imports.unreadable(error), number)
            continue
        # HDF5 stores empty arrays of any size in no bytes, and one array under any number of names.
        if (claimed := claimed + 3 * steps) > most:
            raise DemosError(f"{main} claims at least {claimed} values, but has {most} bytes.")
        records, size = _records(main, number, steps, parts), parts.header.image_size
        rest = [f"{n} of episode_{number}" for n in range(steps)]
        rows = imports.rows_of(records, size, context, "step", rest)
        name = f"{main}, episode_{number}"
        yield ExchangeEpisode(header=parts.header, rows=rows, name=name, outcome=outcome)
    if not ours:
        with files.open_hdf5(main) as file:
            groups = [name for name in files.names_in(file) if name.startswith("episode_")]
            more = {name for group in groups for name in files.names_in(file, group, "infos")}
        if len(groups) != count:
            context.warn(f"total_episodes is {count}, and {main.name} has {len(groups)} episodes.")
        if more:
            context.note(f"The infos are not imported: {few(sorted(more))}.")


@dataclass(frozen=True, slots=True)
class _Parts:
    """Columns of an episode, those of the action and the state with their number of values.

    `picture` is "" without images, and `infos` empty in a dataset of others.
    """

    header: EpisodeHeader
    action: Sequence[tuple[str, int]]
    state: Sequence[tuple[str, int]]
    picture: str
    is_jpeg: bool
    infos: Sequence[str] = ()

    def columns(self, file: Any, number: int) -> dict[str, Any]:
        """Return the columns by name; the rewards of others may be missing."""
        group = f"episode_{number}"
        names = [_TERMINATED, _TRUNCATED, *(name for name, _ in (*self.action, *self.state))]
        names += [*self.infos, *([self.picture] if self.picture else [])]
        if self.infos or _REWARD in files.names_in(file, group):
            names.append(_REWARD)
        return {name: files.column(file, f"{group}/{name}") for name in names}

    def count_steps(self, file: Any, number: int, context: ImportContext) -> int:
        """Return the number of steps; refuse an episode whose columns have different lengths."""
        columns = self.columns(file, number)
        ends = columns[_TERMINATED]
        steps = int(ends.shape[0])
        if _REWARD not in columns:
            context.warn(f"{Path(file.filename).name} has no rewards: the steps have none.")
        observed = {self.picture, *(name for name, _ in self.state)} - {_JPEG}
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


def _own(file: Any, number: int, header: EpisodeHeader) -> _Parts:
    """Return the parts of an episode that Shapechanger exported."""
    infos = files.names_in(file, f"episode_{number}", "infos")
    pictured = "frame" in infos
    state, picture = _observed(pictured, bool(header.state_layout))
    return _Parts(
        header=header,
        action=[(_ACTION, header.action_size)],
        state=[(state, header.state_size)] if header.state_layout else [],
        picture=(_JPEG if "jpeg" in infos else picture) if pictured else "",
        is_jpeg=True,
        infos=(_STEP, _FRAME) if pictured else (_STEP,),
    )


def _observed(picture: bool, state: bool) -> tuple[str, str]:
    """Return the columns of the state and of the image in an own dataset."""
    return (_STATE, _PICTURE) if picture and state else (_OBSERVATIONS, _OBSERVATIONS)


def _foreign(main: Path, path: Path, metadata: dict[str, Any], context: ImportContext) -> _Parts:
    """Return the parts of the episodes of a dataset of others."""
    observed, acted = (
        minari_spaces.leaves_in(metadata, f"{of}_space", path) for of in ("observation", "action")
    )
    sizes = {name: minari_spaces.picture_size_of(space) for name, space in observed.items()}
    pictured = [name for name, size in sizes.items() if size is not None]
    if len(pictured) > 1:
        raise DemosError(
            f"An observation in {main} has {len(pictured)} images ({', '.join(pictured)}), but "
            "an episode has one camera: keep one of them in the dataset."
        )
    sensed = {
        name: space
        for name, space in observed.items()
        if name not in pictured and minari_spaces.is_imported(name, space, context)
    }
    hz = metadata.get("control_hz", context.hz)
    known = isinstance(hz, int | float) and math.isfinite(hz) and hz > 0.0
    if not known:
        context.note(f"The rate is unknown and taken to be {DEFAULT_HZ:g} Hz; --hz states it.")
    camera = "".join(pictured) if pictured else None
    action_layout, state_layout = (
        imports.as_json(
            [f for name, leaf in leaves.items() for f in minari_spaces.features(name, leaf, what)]
        )
        for leaves, what in ((acted, "action"), (sensed, "observation"))
    )
    header = EpisodeHeader(
        action_layout=action_layout,
        state_layout=state_layout,
        image_size=None if camera is None else sizes[camera],
        control_hz=float(cast("float", hz)) if known else DEFAULT_HZ,
        clock="none",
        source="minari",
        notes={"dataset": str(metadata.get("dataset_id", "")), "rate_is_known": known},
    )

    def places(leaves: dict[str, spaces.Space[Any]], part: str) -> list[tuple[str, int]]:
        sizes = {name: max(1, math.prod(space.shape or ())) for name, space in leaves.items()}
        return [(f"{part}/{name}" if name else part, size) for name, size in sizes.items()]

    return _Parts(
        header=header,
        action=places(acted, _ACTION),
        state=places(sensed, _OBSERVATIONS),
        picture="" if camera is None else f"{_OBSERVATIONS}/{camera}".rstrip("/"),
        is_jpeg=camera is not None
        and bool(metadata.get("jpeg_encoding", True))
        and files.library(_STORAGE).is_image_space(observed[camera]),
    )


def _records(main: Path, number: int, steps: int, parts: _Parts) -> Iterator[SourceRecord]:
    group, size = f"episode_{number}", parts.header.image_size
    with files.open_hdf5(main) as file:
        columns = parts.columns(file, number)
        count = files.chunk_of(columns.values(), _CHUNK)
        for start in range(0, steps, count):
            part = slice(start, min(start + count, steps))
            chunk = {name: values[part] for name, values in columns.items()}
            actions, states = (_flat(chunk, places, main) for places in (parts.action, parts.state))
            for place, step in enumerate(range(part.start, part.stop)):
                at = {name: values[place] for name, values in chunk.items()}
                reward = float(at[_REWARD]) if _REWARD in at else math.nan
                record = SourceRecord(
                    name=f"{step} of {group}",
                    step=Step(
                        action=tuple(actions[place].tolist()),
                        driver="expert",
                        state=tuple(states[place].tolist()),
                        reward=None if math.isnan(reward) else reward,
                        terminated=bool(at[_TERMINATED]),
                        truncated=bool(at[_TRUNCATED]),
                    ),
                )
                if parts.picture:
                    record.frame = int(at[_FRAME]) if _FRAME in at else step
                    stored = at[parts.picture]
                    record.picture = (
                        bytes(stored) if parts.is_jpeg else minari_spaces.pixels_of(stored, size)
                    )
                    if record.picture is None:
                        record.fault = "whose image does not fit its space"
                if parts.infos:
                    _add_rest(record, at[_STEP])
                yield record


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


def _add_rest(record: SourceRecord, text: bytes) -> None:
    """Complete a record of an own dataset; it has a fault if its JSON cannot be read."""
    step = record.step
    columns = {"action": step.action, "state": step.state, "terminated": step.terminated}
    try:
        rest = files.parse_json(text.decode(), _STEP)
        fields = rest["step"] | columns
        if "reward" in fields:
            fields["reward"] = step.reward
        record.step = Step.from_json(fields)
        record.marks = tuple(map(str, rest["marks"]))
        record.dropped = None if rest["dropped"] is None else str(rest["dropped"])
    except (DemosError, ValueError, TypeError, LookupError) as error:
        reason = str(error).removesuffix(".")
        record.fault = f"whose {_STEP} cannot be read ({reason})"


def _write(episodes: Sequence[ExchangeEpisode], folder: Path, context: ExportContext) -> int:
    """Write episodes into an existing folder, as one dataset, and return the number of steps.

    Neither Minari's own folder nor the network is used. The name of the dataset, `context.out`,
    ends in a version.
    """
    name = context.out.name
    if not _NAME.fullmatch(name):
        better = re.sub(r"[^\w-]+", "-", name).strip("-") or "drive"
        raise DemosError(
            f"Minari loads a dataset by its name, which must end in a version: call it "
            f"{context.out.with_name(f'{better}-v0')}, not {context.out}."
        )
    h5py = files.library("h5py")
    header = episodes[0].header
    rows = [iter(episode.rows) for episode in episodes]
    first = next(rows[0])
    rows[0] = chain((first,), rows[0])
    space, picture = minari_spaces.space_of(header, first.jpeg, episodes[0].name)
    storage = files.library(_STORAGE).MinariStorage.new(
        (folder / _DATA).absolute(),  # Minari cannot measure the size of a relative folder.
        observation_space=space,
        action_space=minari_spaces.box_of(header.action_layout),
        data_format="hdf5",
    )
    total, drivers = 0, set[str]()
    with h5py.File(folder / _DATA / _MAIN, "a", track_order=True) as file:
        for number, (episode, remaining) in enumerate(zip(episodes, rows, strict=True)):
            group = file.create_group(f"episode_{number}")
            steps = _write_episode(group, episode, remaining, picture)
            drivers.update(step.driver for step in steps)
            group.attrs["id"] = number
            group.attrs["total_steps"] = len(steps)
            if episode.header.seed is not None:
                group.attrs["seed"] = episode.header.seed
            total += len(steps)
    counts = {"total_episodes": len(episodes), "total_steps": total}
    about = _metadata(name, episodes, drivers) | counts | {"dataset_size": storage.get_size()}
    storage.update_metadata(about)
    return total


def _metadata(name: str, episodes: Sequence[ExchangeEpisode], drivers: set[str]) -> dict[str, Any]:
    header = episodes[0].header
    plain = header.to_json()
    found: dict[str, Any] = {
        "dataset_id": name,
        "minari_version": version("minari"),
        "algorithm_name": ", ".join(sorted(drivers)),
        "description": (
            "Episodes recorded by Shapechanger, and exported without a change: images are JPEG "
            "as recorded, numbers have 64 bits, the last observation of an episode is there twice."
        ),
        "action_layout": plain["action_layout"],
        "observation_layout": plain["state_layout"],
        "control_hz": header.control_hz,
        _OURS: {"format": 1, "episodes": list(map(files.own_fields, episodes))},
    }
    envs = [(episode.header.env, episode.header.env_kwargs) for episode in episodes]
    if header.env in gym.registry and all(env == envs[0] for env in envs):
        spec = copy.deepcopy(gym.spec(header.env))  # For Minari's `recover_environment`.
        spec.kwargs.update(header.env_kwargs)
        found["env_spec"] = spec.to_json()
    if people := {episode.header.driver for episode in episodes if episode.header.driver}:
        found["author"] = people
    return found


def _write_episode(
    group: Any, episode: ExchangeEpisode, rows: Iterable[ExchangeStep], picture: spaces.Box | None
) -> list[Step]:
    """Write the columns of an episode to its group, and return its steps.

    The last observation is repeated. An episode without an end is truncated at its last step: a
    learner must not take the next episode for its continuation.
    """
    header, steps, rests, frames = episode.header, list[Step](), list[str](), list[int]()
    state_at, picture_at = _observed(picture is not None, bool(header.state_layout))
    size, grey = None, False
    observed: list[Any] = []  # The columns of the images; the last one is Minari's.
    if picture is not None:
        size, grey = (picture.shape[1], picture.shape[0]), len(picture.shape) == 2
        as_jpeg = files.library(_STORAGE).is_image_space(picture)
        blob = files.library("h5py").vlen_dtype(np.uint8)
        kinds = {picture_at if as_jpeg else _JPEG: ((), blob)}
        kinds |= {} if as_jpeg else {picture_at: (picture.shape, np.uint8)}
        observed = [
            group.create_dataset(
                at, shape=(0, *shape), maxshape=(None, *shape), dtype=dtype, chunks=True
            )
            for at, (shape, dtype) in kinds.items()
        ]
    frame, shown = -1, np.empty(0)

    def append(at: Any, value: Any) -> None:
        at.resize(len(at) + 1, axis=0)
        at[-1] = value

    for row, jpeg, pixels in decoded_steps(rows, size, episode.name, "Minari"):
        if pixels is not None:
            frame, shown = frame + 1, pixels[..., 0] if grey else pixels
            where = f"of step {len(steps)} of {episode.name}"
            if is_grey(jpeg, where) != grey:
                kind = "coloured" if grey else "grey"
                raise DemosError(
                    f"The image {where} is {kind}, and the first one is not: a Minari dataset "
                    "has images of one kind."
                )
        for at, value in zip(observed, (np.frombuffer(jpeg, np.uint8), shown), strict=False):
            append(at, value)
        steps.append(row.step)
        rest = {n: v for n, v in row.step.to_json().items() if n not in _IN_COLUMNS}
        rests.append(json.dumps({"step": rest, "marks": row.marks, "dropped": row.dropped}))
        frames.append(frame)

    def write(name: str, values: Sequence[Any], dtype: Any) -> None:
        data = np.array(values, dtype)
        shape = (None, *data.shape[1:])
        group.create_dataset(name, data=data, dtype=dtype, maxshape=shape, chunks=True)

    if picture is not None:
        append(observed[-1], observed[-1][-1])
        write(_FRAME, frames, np.int64)
    if header.state_layout:
        write(state_at, [*(step.state for step in steps), steps[-1].state], np.float64)
    write(_ACTION, [step.action for step in steps], np.float64)
    write(_REWARD, [math.nan if s.reward is None else s.reward for s in steps], np.float64)
    ended = steps[-1].terminated
    write(_TERMINATED, [step.terminated for step in steps], np.bool_)
    write(
        _TRUNCATED,
        [*(step.truncated for step in steps[:-1]), not ended or steps[-1].truncated],
        np.bool_,
    )
    write(_STEP, rests, files.library("h5py").string_dtype("utf-8"))
    return steps


FORMAT: Final = Format(
    name="minari",
    title="Minari",
    sign=f"{_DATA}/{_METADATA}",
    detect=lambda folder: _data_folder(folder) is not None,
    read=_read,
    write=_write,
    options=frozenset({"hz", "dropped"}),
    consecutive=True,
)
