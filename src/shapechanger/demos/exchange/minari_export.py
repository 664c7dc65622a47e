"""Export of recordings as Minari datasets; `minari` describes what they hold.

Minari's own writer (`MinariStorage.update_episodes`) is not used for the steps: it decodes and
encodes each picture again at JPEG quality 75, and needs the whole episode in memory.
"""

from __future__ import annotations

import copy
import json
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from itertools import chain, islice
from typing import TYPE_CHECKING, Any, Final, cast

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from shapechanger.demos.exchange.files import library
from shapechanger.demos.exchange.format import (
    ExchangeEpisode,
    ExchangeStep,
    ExportContext,
    fields_of,
    name_in,
    require_alike,
)
from shapechanger.demos.exchange.pictures import Pictures
from shapechanger.demos.jpeg import decode_picture, is_grey, picture_size
from shapechanger.errors import DemosError
from shapechanger.layout import Layout

if TYPE_CHECKING:
    from pathlib import Path

DATA: Final = "data"
METADATA: Final = "metadata.json"
MAIN: Final = "main_data.hdf5"
OURS: Final = "shapechanger"  # Key of our own section in `metadata.json`.
UNKNOWN_NS: Final = -(2**63)
FRAME: Final = "infos/frame"
JPEG: Final = "infos/jpeg"
CUT_OFF: Final = "infos/cut_off"
OBSERVATIONS: Final = "observations"

_NAME: Final = re.compile(r"[\w-]+-v[0-9]+")
_CHUNK: Final = 256  # Steps in memory at once.
_MIN_JPEG: Final = 32
_BRIGHTEST: Final = 255


def write_minari(episodes: Sequence[ExchangeEpisode], folder: Path, context: ExportContext) -> int:
    """Write episodes into an existing folder, as one dataset, and return the number of steps.

    Episodes without steps are left out, because Minari does not support them. Neither Minari's own
    folder nor the network is used. The name of the dataset, `context.out`, ends in a version.
    """
    name = context.out.name
    if not _NAME.fullmatch(name):
        better = re.sub(r"[^\w-]+", "-", name).strip("-") or "drive"
        raise DemosError(
            f"Minari loads a dataset by its name, which must end in a version: call it "
            f"{context.out.with_name(f'{better}-v0')}, not {context.out}."
        )
    h5py = library("h5py")
    storages = library("minari.dataset.minari_storage")
    require_alike(episodes, "a Minari dataset")
    begun = [
        (one, first, rows) for one in episodes if (first := next(rows := iter(one.rows), None))
    ]
    if not begun:
        raise DemosError("There are no steps to export.")
    observed = _observed(*begun[0][:2])
    storage = storages.MinariStorage.new(
        (folder / DATA).absolute(),  # Minari cannot measure the size of a relative folder.
        observation_space=observed.space,
        action_space=_box(begun[0][0].header.action_layout),
        data_format="hdf5",
    )
    total, drivers = 0, set[str]()
    with h5py.File(folder / DATA / MAIN, "a", track_order=True) as file:
        for number, (episode, first, rest) in enumerate(begun):
            group = file.create_group(f"episode_{number}")
            columns = _EpisodeColumns(group, episode, observed)
            rows = chain((first,), rest)
            while chunk := list(islice(rows, _CHUNK)):
                columns.add(chunk)
                drivers.update(row.step.driver for row in chunk)
            columns.close()
            group.attrs["id"] = number
            group.attrs["total_steps"] = columns.steps
            if episode.header.seed is not None:
                group.attrs["seed"] = episode.header.seed
            total += columns.steps
    storage.update_metadata(
        _metadata(name, [episode for episode, *_ in begun], drivers)
        | {"total_episodes": len(begun), "total_steps": total, "dataset_size": storage.get_size()}
    )
    return total


def _metadata(name: str, episodes: Sequence[ExchangeEpisode], drivers: set[str]) -> dict[str, Any]:
    header = episodes[0].header
    plain = header.to_json()
    own = [e.header.to_json() | {"outcome": e.outcome} for e in episodes]
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
        OURS: {"format": 1, "episodes": own},
    }
    envs = [(episode.header.env, episode.header.env_kwargs) for episode in episodes]
    if header.env in gym.registry and all(env == envs[0] for env in envs):
        spec = copy.deepcopy(gym.spec(header.env))  # For Minari's `recover_environment`.
        spec.kwargs.update(header.env_kwargs)
        found["env_spec"] = spec.to_json()
    if people := {episode.header.driver for episode in episodes if episode.header.driver}:
        found["author"] = people
    return found


def _box(layout: str) -> spaces.Box:
    """Return the space of the values of a layout, in 64 bits, so that nothing is rounded."""
    named = Layout.from_json(layout)
    return spaces.Box(named.low, named.high, dtype=np.float64)


def stored_as_jpeg(space: spaces.Space[Any]) -> bool:
    """Return whether Minari stores a space as JPEG: `is_image_space` of its minari_storage.py."""
    box = cast("Any", space)
    return (
        isinstance(space, spaces.Box)
        and len(box.shape) in {2, 3}
        and min(box.shape[:2]) >= _MIN_JPEG
        and box.dtype == np.uint8
        and bool(np.all(box.low == 0) and np.all(box.high == _BRIGHTEST))
    )


@dataclass(frozen=True, slots=True)
class _Observed:
    """The observation of each step: the space of its state and of its picture, if any."""

    state: spaces.Box | None
    picture: spaces.Box | None = None
    is_grey: bool = False
    size: tuple[int, int] | None = None

    @property
    def space(self) -> spaces.Space[Any]:
        """Space of the observations."""
        if self.picture is not None and self.state is not None:
            return spaces.Dict({"image": self.picture, "state": self.state})
        return cast("spaces.Space[Any]", self.picture if self.state is None else self.state)

    def column(self, field: str) -> str:
        """Return the place of the "frame" or the "state" in the file."""
        both = self.picture is not None and self.state is not None
        return name_in("minari", field) if both else OBSERVATIONS


def _observed(episode: ExchangeEpisode, row: ExchangeStep) -> _Observed:
    """Return the observation of the first step, and therefore of all."""
    header = episode.header
    state = _box(header.state_layout) if header.state_layout else None
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
        return _Observed(state)
    where = f"of the first step of {episode.name}"
    width, height = header.image_size or picture_size(row.jpeg, where)
    grey = is_grey(row.jpeg, where)
    shape = (height, width) if grey else (height, width, 3)
    return _Observed(state, spaces.Box(0, _BRIGHTEST, shape, np.uint8), grey, (width, height))


class _EpisodeColumns:
    """Columns of one episode, in an empty `h5py.Group`."""

    def __init__(self, group: Any, episode: ExchangeEpisode, observed: _Observed) -> None:
        self.steps = 0
        self._group = group
        self._name = episode.name
        self._observed = observed
        self._as_jpeg = observed.picture is not None and stored_as_jpeg(observed.picture)
        self._unknown = (math.nan,) * episode.header.action_size
        self._pictures = Pictures(observed.size)
        self._picture: bytes | None = None
        self._pixels: NDArray[np.uint8] | None = None
        self._frame = -1
        self._ends = True
        self._text = library("h5py").string_dtype("utf-8")
        self._blob = library("h5py").vlen_dtype(np.uint8)

    def add(self, rows: Sequence[ExchangeStep]) -> None:
        """Append steps."""
        steps = [row.step for row in rows]
        if self._observed.picture is not None:
            self._add_pictures(rows)
        if self._observed.state is not None:
            self._append(self._observed.column("state"), [s.state for s in steps], np.float64)

        def append(field: str, values: Sequence[Any], dtype: Any) -> None:
            self._append(name_in("minari", field), values, dtype)

        append("action", [step.action for step in steps], np.float64)
        append("reward", [math.nan if s.reward is None else s.reward for s in steps], np.float64)
        self._append("infos/rewarded", [step.reward is not None for step in steps], np.bool_)
        for field in fields_of("flag"):
            append(field, [getattr(step, field) for step in steps], np.bool_)
        for field in ("applied", "wanted"):
            values = [getattr(step, field) for step in steps]
            append(field, [self._unknown if v is None else v for v in values], np.float64)
            self._append(f"infos/has_{field}", [value is not None for value in values], np.bool_)
        for field in fields_of("time"):
            times = [getattr(step, field) for step in steps]
            append(field, [UNKNOWN_NS if time is None else time for time in times], np.int64)
        append("driver", [step.driver for step in steps], self._text)
        # HDF5 cannot store NUL in a text.
        append("stop_reason", [step.stop_reason.replace("\0", "") for step in steps], self._text)
        append("terms", [_more(row) for row in rows], self._text)
        self._ends = steps[-1].terminated or steps[-1].truncated
        self.steps += len(rows)

    def close(self) -> None:
        """Write the last observation and the end of the episode.

        An episode without an end is truncated at its last step: a learner must not take the next
        episode for its continuation.
        """
        for field, there in (("frame", self._observed.picture), ("state", self._observed.state)):
            if there is not None:
                column = self._group[self._observed.column(field)]
                column.resize(len(column) + 1, axis=0)
                column[-1] = column[-2]
        self._append(CUT_OFF, [not self._ends], np.bool_)
        if not self._ends:
            self._group[name_in("minari", "truncated")][-1] = True

    def _add_pictures(self, rows: Sequence[ExchangeStep]) -> None:
        jpegs: list[NDArray[np.uint8]] = []
        pixels: list[NDArray[np.uint8]] = []
        frames: list[int] = []
        for number, row in enumerate(rows, self.steps):
            where = f"of step {number} of {self._name}"
            if row.jpeg is not None:
                self._pictures.check(row.jpeg, where)
                if is_grey(row.jpeg, where) != self._observed.is_grey:
                    kind = "coloured" if self._observed.is_grey else "grey"
                    raise DemosError(
                        f"The picture {where} is {kind}, and the first one is not: a Minari "
                        "dataset has pictures of one kind."
                    )
                self._picture, self._frame = row.jpeg, self._frame + 1
                if not self._as_jpeg:
                    self._pixels = decode_picture(row.jpeg, where, grey=self._observed.is_grey)
            if self._picture is None:
                raise DemosError(f"There is no picture {where}, but Minari needs one: drop it.")
            jpegs.append(np.frombuffer(self._picture, np.uint8))
            frames.append(self._frame)
            if self._pixels is not None:
                pixels.append(self._pixels)
        self._append(FRAME, frames, np.int64)
        column = self._observed.column("frame")
        if not self._as_jpeg:
            self._append(column, pixels, np.uint8)
        self._append(column if self._as_jpeg else JPEG, jpegs, self._blob)

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
    """Return everything without a column of its own, as JSON, which has no NaN and infinity."""
    terms = {n: v if math.isfinite(v) else repr(v) for n, v in row.step.terms.items()}
    more: dict[str, Any] = {"terms": terms} if terms else {}
    if row.marks:
        more["marks"] = list(row.marks)
    if row.dropped is not None:
        more["dropped"] = row.dropped
    if "\0" in row.step.stop_reason:
        more["stop_reason"] = row.step.stop_reason
    return json.dumps(more)
