"""Writes the steps of one episode into a Minari dataset: see `minari_files`."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from itertools import chain, islice
from pathlib import Path
from typing import Any, Final, cast

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from shapechanger.demos.episodes import EpisodeHeader
from shapechanger.demos.exchange import minari_format as files
from shapechanger.demos.exchange.minari_format import (
    GrowingColumns,
    box_of,
    grid_of,
    stored_as_jpeg,
)
from shapechanger.demos.exchange.pictures import Pictures, decode, is_grey, library, size_of
from shapechanger.demos.exchange.recorded import ExchangeStep, Recorded
from shapechanger.errors import DemosError
from shapechanger.layout import Layout

__all__ = ["EpisodeColumns", "Observed", "require_dataset_name", "write_minari"]

_OBSERVATIONS: Final = "observations"


@dataclass(frozen=True, kw_only=True)
class Observed:
    """What a step sees.

    Attributes:
        state: What its numbers mean; None without a state.
        size: Width and height of its picture in pixels; None without pictures.
        grey: Whether pictures have no colours.
    """

    state: Layout | None = None
    size: tuple[int, int] | None = None
    grey: bool = False

    @property
    def picture(self) -> spaces.Box | None:
        """The space of the pictures."""
        return None if self.size is None else grid_of(*self.size, grey=self.grey)

    @property
    def as_jpeg(self) -> bool:
        """Whether Minari stores the pictures as JPEG."""
        picture = self.picture
        return picture is not None and stored_as_jpeg(picture)

    @property
    def space(self) -> spaces.Space[Any]:
        """The space of an observation."""
        picture = self.picture
        state = None if self.state is None else box_of(self.state)
        if picture is not None and state is not None:
            return spaces.Dict({files.IMAGE: picture, files.STATE: state})
        return cast("spaces.Space[Any]", picture if state is None else state)

    def column(self, part: str) -> str:
        """The place of a part of the observations in the file."""
        both = self.size is not None and self.state is not None
        return f"{_OBSERVATIONS}/{part}" if both else _OBSERVATIONS


class EpisodeColumns:
    """The columns of one episode.

    Attributes:
        steps: How many steps were written.
    """

    def __init__(self, group: Any, name: str, observed: Observed, actions: int) -> None:
        self.steps = 0
        self._group = group
        self._columns = GrowingColumns(group)
        self._name = name
        self._observed = observed
        self._as_jpeg = observed.as_jpeg
        self._actions = actions
        self._pictures = Pictures(observed.size)
        self._picture: bytes | None = None
        self._pixels: NDArray[np.uint8] | None = None
        self._frame = -1
        self._ends = True

    def add(self, rows: Sequence[ExchangeStep]) -> None:
        """Append steps.

        Raises:
            DemosError: If one has no picture, or one that does not fit.
        """
        if self._observed.size is not None:
            self._add_pictures(rows)
        if self._observed.state is not None:
            states = np.array([row.step.state for row in rows], np.float64)
            self._columns.numbers(self._observed.column(files.STATE), states)
        steps = [row.step for row in rows]
        numbers, texts = self._columns.numbers, self._columns.texts
        numbers("actions", np.array([step.action for step in steps], np.float64))
        rewards = [math.nan if step.reward is None else step.reward for step in steps]
        numbers("rewards", np.array(rewards, np.float64))
        numbers("terminations", np.array([step.terminated for step in steps]))
        numbers("truncations", np.array([step.truncated for step in steps]))
        numbers("infos/rewarded", np.array([step.reward is not None for step in steps]))
        nothing = (math.nan,) * self._actions
        for name, values in (
            ("applied", [step.applied for step in steps]),
            ("wanted", [step.wanted for step in steps]),
        ):
            known = [nothing if value is None else value for value in values]
            numbers(f"infos/{name}", np.array(known, np.float64))
            numbers(f"infos/has_{name}", np.array([value is not None for value in values]))
        for name in files.TIMES:
            times = [getattr(step, name) for step in steps]
            unknown = [files.UNKNOWN_NS if time is None else time for time in times]
            numbers(f"infos/{name}", np.array(unknown, np.int64))
        texts("infos/driver", [step.driver for step in steps])
        texts("infos/stop_reason", [step.stop_reason for step in steps])
        texts("infos/more", [_more(row) for row in rows])
        self._ends = steps[-1].terminated or steps[-1].truncated
        self.steps += len(rows)

    def close(self) -> int:
        """Give the episode its last observation and its end; how many steps there are.

        Where nobody said that the episode ends, its last step is truncated: a learner must not
        take the next episode for what follows.
        """
        if self._observed.size is not None:
            self._columns.repeat_last(self._observed.column(files.IMAGE))
        if self._observed.state is not None:
            self._columns.repeat_last(self._observed.column(files.STATE))
        self._columns.numbers("infos/cut_off", np.array([not self._ends]))
        if not self._ends:
            self._group["truncations"][-1] = True
        return self.steps

    def _add_pictures(self, rows: Sequence[ExchangeStep]) -> None:
        jpegs: list[bytes] = []
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
                    self._pixels = decode(row.jpeg, where, grey=self._observed.grey)
            if self._picture is None:
                raise DemosError(
                    f"There is no picture {where}, and Minari needs one: drop the step."
                )
            jpegs.append(self._picture)
            frames.append(self._frame)
            if self._pixels is not None:
                pixels.append(self._pixels)
        self._columns.numbers("infos/frame", np.array(frames, np.int64))
        column = self._observed.column(files.IMAGE)
        if self._as_jpeg:
            self._columns.blobs(column, jpegs)
        else:
            self._columns.numbers(column, np.array(pixels, np.uint8))
            self._columns.blobs(f"infos/{files.JPEG}", jpegs)


def _more(row: ExchangeStep) -> str:
    """What has no column of its own, as JSON."""
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


_NAME: Final = re.compile(r"[\w-]+-v[0-9]+")
_CHUNK: Final = 256  # Steps that are in memory at once.


def require_dataset_name(folder: Path) -> None:
    """Refuse a folder that Minari could not load by its name.

    Raises:
        DemosError: If the name does not end in a version.
    """
    if not _NAME.fullmatch(folder.name):
        better = re.sub(r"[^\w-]+", "-", folder.name).strip("-") or "drive"
        raise DemosError(
            f"Minari loads a dataset by its name, which ends in a version: call it "
            f"{folder.with_name(f'{better}-v0')}, and not {folder}."
        )


def write_minari(episodes: Sequence[Recorded], folder: Path, name: str) -> int:
    """Write episodes into a folder that is there, as one dataset.

    Neither Minari's own folder nor the network is used. Episodes without steps are left out:
    Minari has no such thing.

    Args:
        episodes: The episodes, of one layout, one rate and one size of pictures.
        folder: Where to write.
        name: Name of the dataset, with its version.

    Returns:
        How many steps were written.

    Raises:
        DemosError: If the episodes differ, or a step has no picture where others have one, or none
            of them has a picture or a state.
        MissingExtra: If Minari or h5py is not installed.
    """
    h5py = library("h5py")
    storages = library("minari.dataset.minari_storage")
    _require_alike(episodes)
    begun = [(episode, rows) for episode in episodes if (rows := _begun(episode.rows)) is not None]
    if not begun:
        raise DemosError("There are no steps to export.")
    first, (row, _) = begun[0]
    observed = _observed(first, row)
    actions = Layout.from_json(first.header.action_layout)
    storage = storages.MinariStorage.new(
        # Minari cannot measure the size of a relative folder.
        (folder / files.DATA).absolute(),
        observation_space=observed.space,
        action_space=box_of(actions),
        data_format="hdf5",
    )
    total, drivers = 0, set[str]()
    with h5py.File(folder / files.DATA / files.MAIN, "a", track_order=True) as file:
        for number, (episode, (row, rest)) in enumerate(begun):
            group = file.create_group(f"episode_{number}")
            columns = EpisodeColumns(group, episode.name, observed, actions.size)
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
        _metadata(name, [episode for episode, _ in begun], observed, drivers)
        | {"total_episodes": len(begun), "total_steps": total, "dataset_size": storage.get_size()}
    )
    return total


def _begun(rows: Any) -> tuple[ExchangeStep, Iterator[ExchangeStep]] | None:
    """The first row and the others; None if there is none."""
    iterator = iter(rows)
    first = next(iterator, None)
    return None if first is None else (first, iterator)


def _observed(episode: Recorded, row: ExchangeStep) -> Observed:
    """What the first step sees, so all of them must."""
    header = episode.header
    state = Layout.from_json(header.state_layout) if header.state_layout else None
    if row.jpeg is None:
        if header.image_size is not None:
            raise DemosError(
                f"The first step of {episode.name} has no picture, and Minari needs one at every "
                "step: drop the steps before the first picture, or export to csv."
            )
        if state is None:
            raise DemosError(
                f"{episode.name} has neither pictures nor a state, so there is nothing that "
                "Minari could call an observation: export it to csv."
            )
        return Observed(state=state)
    where = f"of the first step of {episode.name}"
    return Observed(
        state=state,
        size=header.image_size or size_of(row.jpeg, where),
        grey=is_grey(row.jpeg, where),
    )


def _require_alike(episodes: Sequence[Recorded]) -> None:
    """Refuse episodes that do not fit into one dataset."""
    for episode in episodes[1:]:
        for what, of in (
            ("actions", _actions),
            ("states", _states),
            ("pictures of", _size),
            ("steps a second:", _rate),
        ):
            ours, theirs = of(episodes[0].header), of(episode.header)
            if ours != theirs:
                raise DemosError(
                    f"{episodes[0].name} has {what} {ours}, and {episode.name} {theirs}: a Minari "
                    "dataset has one kind of episode, so export each kind to a dataset of its own."
                )


def _actions(header: EpisodeHeader) -> str:
    return ", ".join(map(str, Layout.from_json(header.action_layout)))


def _states(header: EpisodeHeader) -> str:
    if not header.state_layout:
        return "of nothing"
    return ", ".join(map(str, Layout.from_json(header.state_layout)))


def _size(header: EpisodeHeader) -> str:
    return "nothing" if header.image_size is None else "{} x {}".format(*header.image_size)


def _rate(header: EpisodeHeader) -> str:
    return f"{header.control_hz:g}"


def _metadata(
    name: str, episodes: Sequence[Recorded], observed: Observed, drivers: set[str]
) -> dict[str, Any]:
    header = episodes[0].header
    found: dict[str, Any] = {
        "dataset_id": name,
        "minari_version": version("minari"),
        "algorithm_name": ", ".join(sorted(drivers)),
        "description": (
            "Episodes recorded by Shapechanger, and exported without a change: pictures are JPEG "
            "as recorded, numbers have 64 bits, the last observation of an episode is there twice."
        ),
        "action_layout": header.to_json()["action_layout"],
        "observation_layout": header.to_json()["state_layout"],
        "control_hz": header.control_hz,
        files.HEADERS: {
            "format": files.HEADERS_FORMAT,
            "episodes": [e.header.to_json() | {"outcome": e.outcome} for e in episodes],
        },
    }
    people = {episode.header.driver for episode in episodes if episode.header.driver}
    if people:
        found["author"] = people
    return found
