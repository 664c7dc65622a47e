"""Export of recordings as Minari datasets.

An observation is the picture, the state, or a dictionary of both. A picture is stored as the JPEG
that was recorded, which Minari decodes on reading; it is not encoded again. Pictures below 32
pixels, which Minari does not store as JPEG, are stored as pixels, with the JPEG beside them. Minari
needs one observation more than there are steps, so the last one is repeated.

The infos of a step, by name:

- `applied`, `wanted`: as the action; `has_applied`, `has_wanted`: whether they are known.
- `driver`, `stop_reason`: text.
- `captured_ns`, `decided_ns`, `wall_ns`: times; `UNKNOWN_NS` if unknown.
- `frame`: index of the picture in the episode, from 0; the same for steps that share one.
- `rewarded`: whether the reward is known; it is NaN if not.
- `more`: JSON of everything else: `terms`, `marks`, `dropped`.

The headers of the episodes, the layouts and the rate are in `metadata.json`.

Minari's own writer (`MinariStorage.update_episodes`) is not used for the steps: it decodes and
encodes each picture again at JPEG quality 75, and needs the whole episode in memory.
"""

from __future__ import annotations

import copy
import json
import math
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from itertools import chain, islice
from pathlib import Path
from typing import Any, Final, cast

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from shapechanger.demos.exchange.files import Pictures, library
from shapechanger.demos.exchange.recorded import ExchangeEpisode, ExchangeStep, require_alike
from shapechanger.demos.jpeg import decode_picture, is_grey, picture_size
from shapechanger.errors import DemosError
from shapechanger.layout import Layout

DATA: Final = "data"
METADATA: Final = "metadata.json"
MAIN: Final = "main_data.hdf5"

IMAGE: Final = "image"
STATE: Final = "state"
JPEG: Final = "jpeg"

HEADERS: Final = "shapechanger"
"""Key of Shapechanger's own section in `metadata.json`."""

HEADERS_FORMAT: Final = 1
"""Version of that section."""

TIMES: Final = ("captured_ns", "decided_ns", "wall_ns")

UNKNOWN_NS: Final = -(2**63)
"""Placeholder for an unknown time, ns."""

_MIN_JPEG_PIXELS: Final = 32
_BRIGHTEST: Final = 255
_NAME: Final = re.compile(r"[\w-]+-v[0-9]+")
_CHUNK: Final = 256  # Steps in memory at once.
_OBSERVATIONS: Final = "observations"


def data_folder(folder: Path) -> Path | None:
    """Return the folder with the files of a dataset: `data`, or `folder` itself; None for none."""
    for place in (folder / DATA, folder):
        if (place / METADATA).is_file():
            return place
    return None


def is_minari(folder: Path) -> bool:
    """Return whether a folder is a Minari dataset."""
    return data_folder(folder) is not None


def stored_as_jpeg(space: spaces.Space[Any]) -> bool:
    """Return whether Minari stores a space as JPEG: `is_image_space` of its minari_storage.py."""
    if not isinstance(space, spaces.Box):
        return False
    box = cast("Any", space)
    return (
        len(box.shape) in {2, 3}
        and min(box.shape[:2]) >= _MIN_JPEG_PIXELS
        and box.dtype == np.uint8
        and bool(np.all(box.low == 0))
        and bool(np.all(box.high == _BRIGHTEST))
    )


def require_dataset_name(folder: Path) -> None:
    """Refuse a folder that Minari could not load by its name.

    Raises:
        DemosError: If the name does not end in a version.
    """
    if not _NAME.fullmatch(folder.name):
        better = re.sub(r"[^\w-]+", "-", folder.name).strip("-") or "drive"
        raise DemosError(
            f"Minari loads a dataset by its name, which must end in a version: call it "
            f"{folder.with_name(f'{better}-v0')}, not {folder}."
        )


def write_minari(episodes: Sequence[ExchangeEpisode], folder: Path, name: str) -> int:
    """Write episodes into an existing folder, as one dataset.

    Episodes without steps are left out, because Minari does not support them. Neither Minari's own
    folder nor the network is used.

    Args:
        episodes: The episodes, with one layout, one rate and one picture size.
        folder: Where to write.
        name: Name of the dataset, with its version.

    Returns:
        Number of steps written.

    Raises:
        DemosError: If the episodes differ, a step lacks a picture that others have, or there are
            neither pictures nor states.
        MissingExtra: If Minari or h5py is not installed.
    """
    h5py = library("h5py")
    storages = library("minari.dataset.minari_storage")
    require_alike(episodes, "a Minari dataset")
    begun = [(episode, rows) for episode in episodes if (rows := _begun(episode.rows)) is not None]
    if not begun:
        raise DemosError("There are no steps to export.")
    first, (row, _) = begun[0]
    observed = _observed(first, row)
    actions = Layout.from_json(first.header.action_layout)
    storage = storages.MinariStorage.new(
        # Minari cannot measure the size of a relative folder.
        (folder / DATA).absolute(),
        observation_space=observed.space,
        action_space=_box(actions),
        data_format="hdf5",
    )
    total, drivers = 0, set[str]()
    with h5py.File(folder / DATA / MAIN, "a", track_order=True) as file:
        for number, (episode, (row, rest)) in enumerate(begun):
            group = file.create_group(f"episode_{number}")
            columns = _EpisodeColumns(group, episode.name, observed, actions.size)
            rows = chain((row,), rest)
            while chunk := list(islice(rows, _CHUNK)):
                columns.add(chunk)
                drivers.update(row.step.driver for row in chunk)
            group.attrs["id"] = number
            group.attrs["total_steps"] = columns.close()
            if episode.header.seed is not None:
                group.attrs["seed"] = episode.header.seed
            total += columns.steps
    storage.update_metadata(
        _metadata(name, [episode for episode, _ in begun], drivers)
        | {"total_episodes": len(begun), "total_steps": total, "dataset_size": storage.get_size()}
    )
    return total


def _begun(rows: Iterable[ExchangeStep]) -> tuple[ExchangeStep, Iterator[ExchangeStep]] | None:
    """Return the first row and an iterator over the others; None if there is none."""
    iterator = iter(rows)
    first = next(iterator, None)
    return None if first is None else (first, iterator)


def _metadata(name: str, episodes: Sequence[ExchangeEpisode], drivers: set[str]) -> dict[str, Any]:
    header = episodes[0].header
    plain = header.to_json()
    found: dict[str, Any] = {
        "dataset_id": name,
        "minari_version": version("minari"),
        "algorithm_name": ", ".join(sorted(drivers)),
        "description": (
            "Episodes recorded by Shapechanger, and exported without a change: pictures are JPEG "
            "as recorded, numbers have 64 bits, the last observation of an episode is there twice."
        ),
        "action_layout": plain["action_layout"],
        "observation_layout": plain["state_layout"],
        "control_hz": header.control_hz,
        HEADERS: {
            "format": HEADERS_FORMAT,
            "episodes": [e.header.to_json() | {"outcome": e.outcome} for e in episodes],
        },
    }
    if (spec := _env_spec(episodes)) is not None:
        found["env_spec"] = spec
    people = {episode.header.driver for episode in episodes if episode.header.driver}
    if people:
        found["author"] = people
    return found


def _env_spec(episodes: Sequence[ExchangeEpisode]) -> str | None:
    """Return the spec of the env of all episodes as JSON, for Minari's `recover_environment`.

    None if they were recorded in several envs or without one, or if no env has this id here.
    """
    envs = [(episode.header.env, episode.header.env_kwargs) for episode in episodes]
    env_id, arguments = envs[0]
    if env_id not in gym.registry or any(env != envs[0] for env in envs):
        return None
    spec = copy.deepcopy(gym.spec(env_id))
    spec.kwargs.update(arguments)
    return spec.to_json()


def _box(layout: Layout) -> spaces.Box:
    """Return the space of the values of a layout, in 64 bits, so that nothing is rounded."""
    return spaces.Box(layout.low, layout.high, dtype=np.float64)


@dataclass(frozen=True, kw_only=True)
class _Observed:
    """Return the observation of a step.

    Attributes:
        state: Layout of the state; None without a state.
        size: Width and height of the picture in pixels; None without pictures.
        grey: Whether pictures have no colours.
    """

    state: Layout | None = None
    size: tuple[int, int] | None = None
    grey: bool = False

    @property
    def picture(self) -> spaces.Box | None:
        """Space of the pictures; None without pictures."""
        if self.size is None:
            return None
        width, height = self.size
        shape = (height, width) if self.grey else (height, width, 3)
        return spaces.Box(0, 255, shape, np.uint8)

    @property
    def space(self) -> spaces.Space[Any]:
        """Space of the observations."""
        picture = self.picture
        state = None if self.state is None else _box(self.state)
        if picture is not None and state is not None:
            return spaces.Dict({IMAGE: picture, STATE: state})
        return cast("spaces.Space[Any]", picture if state is None else state)

    def column(self, part: str) -> str:
        """Return the place of a part of the observations in the file."""
        both = self.size is not None and self.state is not None
        return f"{_OBSERVATIONS}/{part}" if both else _OBSERVATIONS


def _observed(episode: ExchangeEpisode, row: ExchangeStep) -> _Observed:
    """Return what the first step observes, and therefore all must."""
    header = episode.header
    state = Layout.from_json(header.state_layout) if header.state_layout else None
    if row.jpeg is None:
        if header.image_size is not None:
            raise DemosError(
                f"The first step of {episode.name} has no picture, but Minari needs one at every "
                "step: drop the steps before the first picture, or export to csv."
            )
        if state is None:
            raise DemosError(
                f"{episode.name} has neither pictures nor a state, so it has no observations for "
                "Minari: export it to csv."
            )
        return _Observed(state=state)
    where = f"of the first step of {episode.name}"
    return _Observed(
        state=state,
        size=header.image_size or picture_size(row.jpeg, where),
        grey=is_grey(row.jpeg, where),
    )


class _EpisodeColumns:
    """Columns of one episode.

    Args:
        group: An open, empty `h5py.Group`.
        name: How to name the episode in errors.
        observed: What each step observes.
        actions: Number of values in an action.

    Attributes:
        steps: Number of steps written.
    """

    def __init__(self, group: Any, name: str, observed: _Observed, actions: int) -> None:
        self.steps = 0
        self._group = group
        self._name = name
        self._observed = observed
        self._as_jpeg = observed.picture is not None and stored_as_jpeg(observed.picture)
        self._unknown = (math.nan,) * actions
        self._pictures = Pictures(observed.size)
        self._picture: bytes | None = None
        self._pixels: NDArray[np.uint8] | None = None
        self._frame = -1
        self._ends = True
        self._text = library("h5py").string_dtype("utf-8")
        self._blob = library("h5py").vlen_dtype(np.uint8)

    def add(self, rows: Sequence[ExchangeStep]) -> None:
        """Append steps.

        Raises:
            DemosError: If one has no picture, or one that does not fit.
        """
        steps = [row.step for row in rows]
        if self._observed.size is not None:
            self._add_pictures(rows)
        if self._observed.state is not None:
            self._append(self._observed.column(STATE), [step.state for step in steps], np.float64)
        rewards = [math.nan if step.reward is None else step.reward for step in steps]
        self._append("actions", [step.action for step in steps], np.float64)
        self._append("rewards", rewards, np.float64)
        self._append("terminations", [step.terminated for step in steps], np.bool_)
        self._append("truncations", [step.truncated for step in steps], np.bool_)
        self._append("infos/rewarded", [step.reward is not None for step in steps], np.bool_)
        for name in ("applied", "wanted"):
            values = [getattr(step, name) for step in steps]
            known = [self._unknown if value is None else value for value in values]
            self._append(f"infos/{name}", known, np.float64)
            self._append(f"infos/has_{name}", [value is not None for value in values], np.bool_)
        for name in TIMES:
            times = [getattr(step, name) for step in steps]
            known = [UNKNOWN_NS if time is None else time for time in times]
            self._append(f"infos/{name}", known, np.int64)
        text = self._text
        self._append("infos/driver", [step.driver for step in steps], text)
        # HDF5 cannot store NUL in a text.
        self._append("infos/stop_reason", [s.stop_reason.replace("\0", "") for s in steps], text)
        self._append("infos/more", [_more(row) for row in rows], text)
        self._ends = steps[-1].terminated or steps[-1].truncated
        self.steps += len(rows)

    def close(self) -> int:
        """Write the last observation and the end of the episode; return the number of steps.

        An episode without an end is truncated at its last step: a learner must not take the next
        episode for its continuation.
        """
        for part, there in ((IMAGE, self._observed.size), (STATE, self._observed.state)):
            if there is not None:
                column = self._group[self._observed.column(part)]
                last = column[-1]
                column.resize(len(column) + 1, axis=0)
                column[-1] = last
        self._append("infos/cut_off", [not self._ends], np.bool_)
        if not self._ends:
            self._group["truncations"][-1] = True
        return self.steps

    def _add_pictures(self, rows: Sequence[ExchangeStep]) -> None:
        jpegs: list[NDArray[np.uint8]] = []
        pixels: list[NDArray[np.uint8]] = []
        frames: list[int] = []
        for number, row in enumerate(rows, self.steps):
            where = f"of step {number} of {self._name}"
            if row.jpeg is not None:
                self._pictures.check(row.jpeg, where)
                if is_grey(row.jpeg, where) != self._observed.grey:
                    raise DemosError(
                        f"The picture {where} is {'coloured' if self._observed.grey else 'grey'}, "
                        "and the first one is not: a Minari dataset has pictures of one kind."
                    )
                self._picture, self._frame = row.jpeg, self._frame + 1
                if not self._as_jpeg:
                    self._pixels = decode_picture(row.jpeg, where, grey=self._observed.grey)
            if self._picture is None:
                raise DemosError(
                    f"There is no picture {where}, but Minari needs one: drop the step."
                )
            jpegs.append(np.frombuffer(self._picture, np.uint8))
            frames.append(self._frame)
            if self._pixels is not None:
                pixels.append(self._pixels)
        self._append("infos/frame", frames, np.int64)
        column = self._observed.column(IMAGE)
        if not self._as_jpeg:
            self._append(column, pixels, np.uint8)
        self._append(column if self._as_jpeg else f"infos/{JPEG}", jpegs, self._blob)

    def _append(self, name: str, values: Sequence[Any], dtype: Any) -> None:
        """Append values to a column, which is created if it is missing."""
        if name not in self._group:
            shape = () if dtype is self._blob else np.shape(values)[1:]
            self._group.create_dataset(
                name, shape=(0, *shape), maxshape=(None, *shape), dtype=dtype, chunks=True
            )
        column = self._group[name]
        start = len(column)
        column.resize(start + len(values), axis=0)
        if dtype is not self._blob:
            column[start:] = np.array(values, dtype)
        else:  # h5py takes several arrays of equal length for one two-dimensional array.
            for number, value in enumerate(values, start):
                column[number] = value


def _more(row: ExchangeStep) -> str:
    """Return everything without a column of its own, as JSON."""
    more: dict[str, Any] = {}
    if row.step.terms:
        # JSON has neither NaN nor infinity.
        more["terms"] = {
            name: value if math.isfinite(value) else repr(value)
            for name, value in row.step.terms.items()
        }
    if row.marks:
        more["marks"] = list(row.marks)
    if row.dropped is not None:
        more["dropped"] = row.dropped
    if "\0" in row.step.stop_reason:
        more["stop_reason"] = row.step.stop_reason
    return json.dumps(more)
