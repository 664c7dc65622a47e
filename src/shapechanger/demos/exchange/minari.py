"""Minari datasets: lossless from Shapechanger, and as complete as possible from other programs.

An observation is the image, the state, or a dictionary of both. The last observation is repeated,
because Minari needs one more than there are steps. Images are stored as the recorded JPEGs, which
Minari decodes on reading; images below 32 pixels, which it does not decode, are not exported.
`infos/frame` is the index of the image in the episode, and `infos/step` contains all fields without
a separate column, as JSON. An unknown reward is NaN. `metadata.json` has the episodes' headers.

Minari's own writer (`MinariStorage.update_episodes`) is not used: it decodes and encodes each image
again at JPEG quality 75, and needs the whole episode in memory.
"""

from __future__ import annotations

import copy
import json
import math
import re
from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.metadata import version
from itertools import chain
from pathlib import Path
from typing import Annotated, Any, Final

import gymnasium as gym
import msgspec
import numpy as np
from gymnasium import spaces

from shapechanger.demos.episodes import EpisodeHeader, Step
from shapechanger.demos.exchange import base, files
from shapechanger.demos.exchange.files import MAX_UNPACKED, MAX_VALUES, library
from shapechanger.demos.jpeg import is_grey
from shapechanger.errors import DemosError, translate_errors
from shapechanger.layout import Feature, Layout

_DATA: Final = "data"
_METADATA: Final = "metadata.json"
_MAIN: Final = "main_data.hdf5"
_OURS: Final = "shapechanger"  # Key of our own section in `metadata.json`.
_OBSERVATIONS, _FRAME = "observations", "infos/frame"
_ACTION, _REWARD, _TERMINATED, _TRUNCATED, _STEP = (
    base.COLUMNS[field]["minari"]
    for field in ("action", "reward", "terminated", "truncated", "driver")
)
_IN_COLUMNS: Final = ("kind", "action", "state", "frame")  # Keys left out of `infos/step`.
_NAME: Final = re.compile(r"[\w-]+-v[0-9]+")
_CHUNK: Final = 64  # Steps in memory at once.
_MIN_PICTURE: Final = 8  # Smallest width and height of images, pixels; smaller grids are maps.
_MIN_JPEG: Final = 32  # Minari 0.5 stores narrower or lower images as pixels (`is_image_space`).
_DEEP: Final = ("uint16", "int16", "uint32")  # Types of depth images.
_DESCRIPTION: Final = (
    "Episodes recorded by Shapechanger, and exported without changes: images are the recorded "
    "JPEGs, numbers have 64 bits, and the last observation of an episode is repeated."
)


class _Rest(msgspec.Struct):  # Content of `infos/step`: fields of a step that have no column.
    step: dict[str, Any]
    marks: tuple[str, ...]
    dropped: str | None


class _Metadata(msgspec.Struct, kw_only=True):
    observation_space: str
    action_space: str
    total_episodes: Annotated[int, msgspec.Meta(ge=1)]
    data_format: str = "hdf5"
    dataset_id: str = ""
    control_hz: float | None = None
    ours: Any = msgspec.field(default=None, name=_OURS)


class _Space(msgspec.Struct, kw_only=True):
    """A space of Gymnasium in Minari's JSON; each type of space has some of these fields."""

    type: str
    dtype: str = ""
    shape: tuple[Annotated[int, msgspec.Meta(ge=0)], ...] = ()
    low: Any = 0
    high: Any = 1
    start: Any = 0
    n: Any = 0
    subspaces: dict[str, _Space] | list[_Space] = []

    def leaves(self, column: str) -> Iterator[tuple[str, _Space]]:
        """Yield the column and space of each leaf, in the order of Minari's files."""
        match self.subspaces:
            case dict() as named:
                inner = sorted(named.items())
            case listed:
                inner = [(f"_index_{n}", one) for n, one in enumerate(listed)]
        for key, one in inner:
            yield from one.leaves(f"{column}/{key}")
        if self.type not in {"Dict", "Tuple"}:
            yield column, self

    def bounds(self) -> list[list[float]]:
        """Return the low and high bounds of the numbers; [] for spaces that are not imported."""
        shape, low, high = self.shape, self.low, self.high
        match self.type:
            case "Box":
                shape = (0,) if len(shape) > 1 and self.dtype in _DEEP else shape
            case "Discrete":
                low, high = self.start, self.start + self.n - 1
            case _:
                return []
        if not 0 < (size := math.prod(shape)) <= MAX_VALUES:
            return []
        ends = (np.ravel(end).astype(float) for end in (low, high))
        return [np.broadcast_to(end, size).tolist() for end in ends]

    def image_size(self) -> tuple[int, int] | None:
        """Return the width and height of an image space; None for other spaces."""
        size = files.image_size(self.shape) if (self.type, self.dtype) == ("Box", "uint8") else None
        return size if size and min(size) >= _MIN_PICTURE else None


def _metadata_of(folder: Path) -> Path | None:
    """Return the path of the metadata in `data` or in the folder itself; None without a file."""
    paths = (folder / _DATA / _METADATA, folder / _METADATA)
    return next((path for path in paths if path.is_file()), None)


@contextmanager
def _opened(path: Path) -> Generator[Any]:
    """Open an HDF5 file for reading, and refuse damaged files."""
    kinds, wrong = (OSError, RuntimeError, KeyError), f"{path} is not an intact HDF5 file"
    with (
        translate_errors(*kinds, to=lambda error: DemosError(f"{wrong}: {error}.")),
        library("h5py").File(path, "r") as file,
    ):
        yield file


def _arrays(file: Any, name: str) -> dict[str, Any]:
    """Return the arrays of an episode, keyed by path; links and external files are not followed."""
    h5py, found = library("h5py"), dict[str, Any]()
    is_there = isinstance(file.get(name, getlink=True), h5py.HardLink)
    if not is_there or not isinstance(file[name], h5py.Group):
        raise DemosError(f"{file.filename} has no {name}.")
    file[name].visititems(found.__setitem__)
    return {
        path: one
        for path, one in found.items()
        if isinstance(one, h5py.Dataset) and one.shape and not one.external and not one.is_virtual
    }


class _Dataset:
    def __init__(self, folder: Path, context: base.ImportContext) -> None:
        path = _metadata_of(folder) or folder / _METADATA
        about: _Metadata = files.read_json(path, _Metadata)
        if about.data_format != "hdf5":
            raise DemosError(f"{folder} is stored as {about.data_format!r}: only 'hdf5' is read.")
        self._context, self._count = context, about.total_episodes
        self._main = files.inside(path.parent, _MAIN, path)
        self._values = self._main.stat().st_size  # Most values that unread episodes can have.
        if self._count > self._values:
            raise DemosError(f"{path} claims {self._count} episodes, but {_MAIN} is smaller.")
        texts = {_OBSERVATIONS: about.observation_space, _ACTION: about.action_space}
        observed, acted = (
            dict(files.parse_json(text, f"A space in {path}", _Space).leaves(column))
            for column, text in texts.items()
        )
        self._images = {at: space for at, space in observed.items() if space.image_size()}
        if len(self._images) > 1:
            names = ", ".join(self._images)
            raise DemosError(f"{path} has {len(self._images)} images ({names}): keep one.")
        sensed = {at: space for at, space in observed.items() if at not in self._images}
        try:
            self._state, self._action = self._features(sensed), self._features(acted)
        except (TypeError, ValueError) as error:
            raise DemosError(f"A space in {path} is damaged: {error}.") from error
        if len(self._action) < len(acted):
            raise DemosError(
                f"{path}: the action_space must consist of Box or Discrete of few values."
            )
        hz = about.control_hz or context.hz
        if hz is None or not 0.0 < hz < math.inf:
            context.report("note", base.UNKNOWN_RATE)
            hz = None
        self._header = EpisodeHeader(
            action_layout=Layout(tuple(chain(*self._action.values()))),
            state_layout=Layout(tuple(chain(*self._state.values()))),
            image_size=next((space.image_size() for space in self._images.values()), None),
            control_hz=hz or base.DEFAULT_HZ,
            clock="none",
            source="minari",
            notes={"dataset": about.dataset_id, "rate_is_known": hz is not None},
        )
        self._own = files.own_episodes(about.ours, path, self._count, self._header)

    def _features(self, leaves: Mapping[str, _Space]) -> dict[str, list[Feature]]:
        """Return the features of numeric leaves, keyed by column, and report other leaves."""
        found: dict[str, list[Feature]] = {}
        for column, space in leaves.items():
            part, _, key = column.partition("/")
            part = part.removesuffix("s")
            name = key or part
            if ends := space.bounds():
                found[column] = base.features_of(name, len(ends[0]), low=ends[0], high=ends[1])
            else:
                about = f"{part} {name} ({space.type} {space.dtype} {list(space.shape)})"
                self._context.report("note", f"The {about} is not imported.")
        return found

    def read(self) -> Iterator[base.ExchangeEpisode]:
        """Yield the episodes."""
        with _opened(self._main) as file:
            if (groups := sum(name.startswith("episode_") for name in file)) != self._count:
                text = f"total_episodes is {self._count}, and {_MAIN} has {groups} episodes."
                self._context.report("warning", text)
        for number in range(self._count):
            header, outcome, _ = self._own[number] if self._own else (self._header, "", None)
            where = f"episode_{number}"
            records, name = self._records(where), f"{where} of {_MAIN}"
            yield base.ExchangeEpisode(header=header, records=records, name=name, outcome=outcome)

    def _columns(self, file: Any, where: str) -> dict[str, Any]:
        """Return the columns of an episode; refuse columns that do not fit together."""
        arrays = _arrays(file, where)
        sizes = {_TERMINATED: 1, _TRUNCATED: 1, _REWARD: 1}
        for column, features in (self._action | self._state).items():
            sizes[column] = sum(feature.size for feature in features)
        infos = [_STEP, *([_FRAME] if self._images else [])] if self._own else []
        names = [*sizes, *infos, *self._images]
        if missing := [name for name in names if name not in arrays]:
            raise DemosError(f"{where} has no {missing[0]!r} that is an array in this file.")
        others = sorted(name for name in arrays if name.startswith("infos/"))
        if others and not self._own:
            self._context.report("note", f"The infos are not imported: {base.few(others)}.")
        columns = {name: arrays[name] for name in names}
        steps = len(columns[_TERMINATED])
        for name, one in columns.items():
            # HDF5 unpacks a whole chunk to read a row.
            row, chunk = one.nbytes // max(1, len(one)), math.prod(one.chunks or ())
            if (unpacked := max(row, chunk * one.dtype.itemsize)) > MAX_UNPACKED:
                raise DemosError(f"{where}: {name!r} unpacks to {unpacked} bytes: too many.")
            # An episode may have one more observation than steps.
            if len(one) not in {steps, steps + name.startswith(_OBSERVATIONS)}:
                raise DemosError(f"{where}: {name!r} has {len(one)} entries for {steps} steps.")
            shape, fits = one.shape[1:], True
            if name in sizes:
                fits = one.dtype.kind in "biuf" and math.prod(shape) == sizes[name]
            elif name in self._images and len(shape) > 1:  # Other rows are JPEGs.
                fits = one.dtype == np.uint8 and shape == self._images[name].shape
            if not fits:
                raise DemosError(f"{where}: {name!r} has {one.dtype} {shape}, unlike its space.")
        stated = file[where].attrs.get("total_steps", steps)
        if not np.array_equal(np.ravel(stated), [steps]):
            raise DemosError(f"{where} has {steps} steps, but its total_steps is {stated}.")
        # HDF5 can claim arrays of any size without bytes, and one array under many names.
        self._values -= 3 * steps
        if self._values < 0:
            raise DemosError(f"{_MAIN} claims at least {3 * steps} values, but is smaller.")
        return columns

    def _records(self, where: str) -> Iterator[base.ExchangeRecord]:
        with _opened(self._main) as file:
            columns = self._columns(file, where)
            steps, size = len(columns[_TERMINATED]), sum(one.nbytes for one in columns.values())
            chunk = max(1, min(_CHUNK, steps * MAX_UNPACKED // max(1, size)))
            for start in range(0, steps, chunk):
                part = [one[start : min(start + chunk, steps)] for one in columns.values()]
                for number, values in enumerate(zip(*part, strict=True), start):
                    name = f"step {number} of {where}"
                    try:
                        record = self._record(dict(zip(columns, values, strict=True)), number)
                    except (ValueError, TypeError, RecursionError, msgspec.DecodeError) as error:
                        raise DemosError(f"{_STEP} of {name} is damaged: {error}.") from error
                    record.name = name
                    yield record

    def _record(self, row: Mapping[str, Any], number: int) -> base.ExchangeRecord:
        (reward,), action, state = (
            [value for name in names for value in np.ravel(row[name]).astype(float).tolist()]
            for names in ([_REWARD], self._action, self._state)
        )
        fields: dict[str, Any] = {"driver": "expert", "truncated": bool(row[_TRUNCATED])}
        rest = _Rest(step=fields, marks=(), dropped=None)
        if self._own:
            rest = msgspec.json.decode(row[_STEP], type=_Rest)
        if "reward" in rest.step or not (self._own or math.isnan(reward)):
            rest.step["reward"] = reward
        known = {"action": action, "state": state, "terminated": bool(row[_TERMINATED])}
        record = base.ExchangeRecord(step=Step.from_json(rest.step | known))
        record.marks, record.dropped = rest.marks, rest.dropped
        for name in self._images:
            record.frame, stored = int(row.get(_FRAME, number)), row[name]
            if np.ndim(stored) > 1:
                pixels = np.atleast_3d(stored)
                # Colours come last, and there are three.
                pixels = pixels if pixels.shape[-1] in {1, 3} else np.moveaxis(pixels, 0, -1)
                record.image = np.repeat(pixels, 3 // pixels.shape[-1], -1)
            else:
                record.image = bytes(stored)
        return record


def _write(
    episodes: Sequence[base.ExchangeEpisode], folder: Path, context: base.ExportContext
) -> int:
    """Write episodes into an existing folder, as one dataset, and return the number of steps."""
    name, header, place = context.out.name, episodes[0].header, folder / _DATA
    size = header.image_size
    if not _NAME.fullmatch(name):
        better = re.sub(r"[^\w-]+", "-", name).strip("-") or "drive"
        better = context.out.with_name(f"{better}-v0")
        raise DemosError(f"A Minari dataset needs a name with a version: call it {better}.")
    if size is None and not header.state_layout:
        raise DemosError(f"{episodes[0].name} has neither images nor a state: export it to csv.")
    if size is not None and min(size) < _MIN_JPEG:
        text = "Minari stores no images of {} x {} pixels as JPEG".format(*size)
        raise DemosError(f"{text}: export {episodes[0].name} to csv or lerobot.")
    place.mkdir()
    total, drivers, greys = 0, set[str](), set[bool]()
    with library("h5py").File(place / _MAIN, "w", track_order=True) as file:
        for number, episode in enumerate(episodes):
            group = file.create_group(f"episode_{number}")
            steps = _write_episode(group, episode, greys)
            group.attrs.update({"id": number, "total_steps": len(steps)})
            if episode.header.seed is not None:
                group.attrs["seed"] = episode.header.seed
            drivers.update(step.driver for step in steps)
            total += len(steps)
    observed = dict[str, spaces.Space[Any]]()
    if size is not None:
        shape = size[::-1] if True in greys else (*size[::-1], 3)
        observed["image"] = spaces.Box(0, 255, shape, np.uint8)
    if states := header.state_layout:
        observed["state"] = spaces.Box(states.low, states.high, dtype=np.float64)
    space = spaces.Dict(observed) if len(observed) > 1 else next(iter(observed.values()))
    acted = spaces.Box(header.action_layout.low, header.action_layout.high, dtype=np.float64)
    as_text = library("minari.serialization").serialize_space
    own = [episode.header.to_json() | {"outcome": episode.outcome} for episode in episodes]
    about: dict[str, Any] = {
        "data_format": "hdf5",
        "jpeg_encoding": True,
        "observation_space": as_text(space),
        "action_space": as_text(acted),
        "dataset_id": name,
        "minari_version": version("minari"),
        "algorithm_name": ", ".join(sorted(drivers)),
        "description": _DESCRIPTION,
        "action_layout": own[0]["action_layout"],
        "observation_layout": own[0]["state_layout"],
        "control_hz": header.control_hz,
        _OURS: {"format": 1, "episodes": own},
        "total_episodes": len(episodes),
        "total_steps": total,
        "dataset_size": round((place / _MAIN).stat().st_size / 1e6, 1),  # Megabytes.
    }
    envs = [(episode.header.env, episode.header.env_kwargs) for episode in episodes]
    if header.env in gym.registry and all(env == envs[0] for env in envs):
        spec = copy.deepcopy(gym.spec(header.env))  # For Minari's `recover_environment`.
        spec.kwargs.update(header.env_kwargs)
        about["env_spec"] = spec.to_json()
    if people := {episode.header.driver for episode in episodes if episode.header.driver}:
        about["author"] = sorted(people)
    (place / _METADATA).write_text(json.dumps(about))
    return total


def _write_episode(group: Any, episode: base.ExchangeEpisode, greys: set[bool]) -> list[Step]:
    """Write the columns of an episode to its group, and return its steps.

    A last step that does not end the episode is marked as truncated, so that learners do not
    continue with the next episode. `greys` collects whether images are grey.
    """
    header, variable = episode.header, library("h5py").vlen_dtype(np.uint8)
    steps, rests, frames = list[Step](), list[str](), list[int]()
    is_dict = header.image_size is not None and bool(header.state_layout)
    state_at, image_at = (_OBSERVATIONS + at * is_dict for at in ("/state", "/image"))
    images: Any = None
    if header.image_size is not None:
        images = group.create_dataset(image_at, (0,), variable, maxshape=(None,), chunks=True)

    def show(jpeg: bytes) -> None:
        if images is not None:
            images.resize(len(images) + 1, axis=0)
            images[-1] = np.frombuffer(jpeg, np.uint8)

    jpeg, frame = b"", -1
    for record, pixels in base.decoded_images(episode, "Minari"):
        if pixels is not None:
            frame, jpeg = frame + 1, record.jpeg or b""
            where = f"of step {len(steps)} of {episode.name}"
            greys.add(is_grey(jpeg, where))
            if len(greys) > 1:
                raise DemosError(f"Minari cannot mix grey and coloured images: image {where}.")
        show(jpeg)
        steps.append(record.step)
        rest = {n: v for n, v in record.step.to_json().items() if n not in _IN_COLUMNS}
        rests.append(json.dumps({"step": rest, "marks": record.marks, "dropped": record.dropped}))
        frames.append(frame)
    show(jpeg)
    last = steps[-1]
    cut = [*(step.truncated for step in steps[:-1]), last.truncated or not last.terminated]
    rewards = [math.nan if step.reward is None else step.reward for step in steps]
    columns = {
        _ACTION: np.array([step.action for step in steps], np.float64),
        _REWARD: np.array(rewards, np.float64),
        _TERMINATED: np.array([step.terminated for step in steps]),
        _TRUNCATED: np.array(cut),
        _STEP: np.array(rests, library("h5py").string_dtype("utf-8")),
    }
    if header.state_layout:
        columns[state_at] = np.array([step.state for step in (*steps, last)], np.float64)
    if images is not None:
        columns[_FRAME] = np.array(frames, np.int64)
    for name, values in columns.items():
        most = (None, *values.shape[1:])
        group.create_dataset(name, data=values, maxshape=most, chunks=True)
    return steps


FORMAT: Final = base.Format(
    name="minari",
    title="Minari",
    sign=f"{_DATA}/{_METADATA}",
    detect=lambda folder: _metadata_of(folder) is not None,
    read=lambda folder, context: _Dataset(folder, context).read(),
    write=_write,
    options=frozenset({"hz", "dropped"}),
    consecutive=True,
)
