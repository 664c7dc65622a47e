"""Demonstrations as arrays to learn from."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import compress
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.episodes import (
    DRIVERS,
    EpisodeHeader,
    Step,
    episodes_of,
    read_episode,
)
from shapechanger.demos.episodes.files import is_episode
from shapechanger.demos.exchange import import_episodes
from shapechanger.demos.jpeg import decode_picture
from shapechanger.demos.statistics import is_same_rate, rate_jitter
from shapechanger.errors import DemosError, UnknownName
from shapechanger.layout import Layout

_NS_PER_S: Final = 1e9

DEMONSTRATORS: Final = ("person", "expert")
"""Drivers from whose steps policies learn."""

Shrink = Callable[[NDArray[np.uint8], EpisodeHeader], NDArray[np.uint8]]
"""Function that reduces an image of an episode, shape (H, W, 3), to save memory."""


@dataclass(frozen=True)
class Dataset:
    """Observations and actions of one or more episodes, step by step.

    Attributes:
        pictures: Red, green and blue, shape (n, H, W, 3); None without images.
        states: Shape (n, k), NaN where nothing measured a value; None without states.
        actions: Decided actions, shape (n, m), in the order of the layout.
        episodes: Number of steps of each episode, in order; each positive.
        times_s: Time of each step since the start of its episode, s, shape (n,).
        files: Origin of each step, for people to read; () if unknown.
        action_layout: Meaning of the values of an action.
        state_layout: Meaning of the values of a state; None without states.
        control_hz: Steps per second.
        body: Kind of robot of the first episode, such as "car"; "" if unknown.
        rate_jitter: How far the rate varied, as a share of it; see `statistics.rate_jitter`.
    """

    pictures: NDArray[np.uint8] | None
    states: NDArray[np.float32] | None
    actions: NDArray[np.float32]
    episodes: tuple[int, ...]
    times_s: NDArray[np.float64]
    files: tuple[str, ...]
    action_layout: Layout
    state_layout: Layout | None
    control_hz: float
    body: str = ""
    rate_jitter: float = 0.0

    def __len__(self) -> int:
        """Return the number of steps."""
        return len(self.actions)

    def __repr__(self) -> str:
        """Describe the shapes instead of printing the arrays."""
        seen = "no pictures" if self.pictures is None else f"pictures {self.pictures.shape[1:]}"
        return f"Dataset({len(self)} steps of {len(self.episodes)} episodes, {seen})"

    @property
    def duration_s(self) -> float:
        """Length by the times, s; the last step of an episode takes the inverse of the rate."""
        ends = np.cumsum(self.episodes)
        begins = ends - np.asarray(self.episodes)
        total = float((self.times_s[ends - 1] - self.times_s[begins]).sum())
        return total + (len(ends) / self.control_hz if self.control_hz > 0.0 else 0.0)

    def part(self, which: NDArray[np.bool_]) -> Dataset:
        """Return the steps that a mask of shape (n,) selects."""
        episodes = np.split(which, np.cumsum(self.episodes)[:-1])
        return replace(
            self,
            pictures=None if self.pictures is None else self.pictures[which],
            states=None if self.states is None else self.states[which],
            actions=self.actions[which],
            episodes=tuple(int(steps.sum()) for steps in episodes if steps.any()),
            times_s=self.times_s[which],
            files=tuple(compress(self.files, which)),
        )


def merged(datasets: Sequence[Dataset]) -> Dataset:
    """Return the steps of several datasets of images, whose other attributes are of the first."""
    pictures = [data.pictures for data in datasets if data.pictures is not None]
    return replace(
        datasets[0],
        pictures=np.concatenate(pictures),
        states=None,
        actions=np.concatenate([data.actions for data in datasets]),
        episodes=tuple(length for data in datasets for length in data.episodes),
        times_s=np.concatenate([data.times_s for data in datasets]),
        files=tuple(file for data in datasets for file in data.files),
        state_layout=None,
    )


def load_dataset(
    data: Path,
    *,
    drivers: Collection[str] = DEMONSTRATORS,
    shrink: Shrink | None = None,
) -> Dataset:
    """Read demonstrations in any supported format.

    Dropped steps and steps of other drivers are left out.

    Args:
        data: A recording, one episode of it, or anything that `shapechanger demos import` reads.
            It is not changed.
        drivers: Drivers whose steps to load.
        shrink: Function that reduces each image, to save memory; None to keep it as it is.

    Raises:
        DemosError: If there are no such steps, or the episodes do not match each other.
        UnknownName: If there is no such driver.
    """
    for driver in drivers:
        if driver not in DRIVERS:
            raise UnknownName("driver", driver, DRIVERS)
    parts = [part for part in _parts(data, drivers, shrink) if part.steps]
    if not parts:
        raise DemosError(f"There is no step of {' or '.join(sorted(drivers))} in {data}.")
    for part in parts[1:]:
        _require_same(part, parts[0])
    header = parts[0].header
    pictures = [picture for part in parts for picture in part.pictures]
    steps = [step for part in parts for step in part.steps]
    layout = Layout.from_json(header.state_layout) if header.state_layout else None
    periods_s: list[float] = []
    for part in parts:
        if all(step.captured_ns is not None for step in part.steps):
            follows = np.diff([step.index for step in part.steps]) == 1
            periods_s += np.diff(part.times_s())[follows].tolist()
    return Dataset(
        pictures=np.stack(pictures) if pictures else None,
        states=np.array([step.state for step in steps], np.float32) if layout else None,
        actions=np.array([step.action for step in steps], np.float32),
        episodes=tuple(len(part.steps) for part in parts),
        times_s=np.concatenate([part.times_s() for part in parts]),
        files=tuple(f"{part.name}, step {step.index}" for part in parts for step in part.steps),
        action_layout=Layout.from_json(header.action_layout),
        state_layout=layout,
        control_hz=header.control_hz,
        body=header.body,
        rate_jitter=rate_jitter(periods_s, header.control_hz),
    )


def count_steps(data: Path) -> int:
    """Count the steps that `load_dataset` would load by default, without decoding any image."""
    return sum(step.driver in DEMONSTRATORS for _, _, steps in _episodes(data) for step, _ in steps)


class _Part(NamedTuple):
    """The chosen steps of one episode, each with its image if there are any."""

    name: str
    header: EpisodeHeader
    steps: list[Step]
    pictures: list[NDArray[np.uint8]]

    def times_s(self) -> NDArray[np.float64]:
        """Return the time of each step, s; from the rate where a time is missing."""
        indices = [step.index for step in self.steps]
        known = [step.captured_ns for step in self.steps if step.captured_ns is not None]
        if len(known) < len(self.steps):
            return (np.array(indices) - indices[0]) / self.header.control_hz
        times_s = (np.array(known, np.int64) - known[0]) / _NS_PER_S
        if (np.diff(times_s) < 0.0).any():
            worst = int(np.diff(times_s).argmin())
            raise DemosError(
                f"Time runs backwards in {self.name} after step {indices[worst]}: exclude steps "
                "with `shapechanger demos bad`."
            )
        return times_s


def _parts(data: Path, drivers: Collection[str], shrink: Shrink | None) -> Iterator[_Part]:
    """Yield each episode, in order."""
    for name, header, steps in _episodes(data):
        part = _Part(name, header, [], [])
        newest = decoded = None
        pixels = np.empty((0, 0, 3), np.uint8)
        for step, jpeg in steps:
            newest = jpeg or newest
            if step.driver not in drivers:
                continue
            part.steps.append(step)
            if newest is None:
                continue
            if newest is not decoded and newest != decoded:
                decoded, where = newest, f"{name}/{step.frame or step.index}"
                pixels = decode_picture(newest, where)
                size, expected = (pixels.shape[1], pixels.shape[0]), header.image_size
                if expected and expected != size:
                    text = "{} has {} x {} pixels, but the other images {} x {}."
                    raise DemosError(text.format(where, *size, *expected))
                pixels = pixels if shrink is None else shrink(pixels, header)
            part.pictures.append(pixels)
        if len(part.pictures) not in {0, len(part.steps)}:
            raise DemosError(f"Only some steps of {name} have images.")
        yield part


def _episodes(
    data: Path,
) -> Iterator[tuple[str, EpisodeHeader, Iterator[tuple[Step, bytes | None]]]]:
    """Yield the name, the header, and the kept steps with their images, of each episode."""
    is_recording = data.is_dir() and any(map(is_episode, (data, *data.iterdir())))
    if is_recording or not data.exists():
        for path in episodes_of(data):
            episode = read_episode(path)
            kept = ((step, episode.jpeg(step)) for step in episode.kept)
            yield str(path), episode.header, kept
        return

    for number, (header, steps) in enumerate(import_episodes(data)):
        yield f"{data}, episode {number}", header, iter(steps)


def _require_same(part: _Part, first: _Part) -> None:
    """Refuse an episode that differs in layout, image size or rate."""
    one, other = part.header, first.header
    same = {
        "actions": one.action_layout == other.action_layout,
        "states": one.state_layout == other.state_layout,
        "pictures": one.image_size == other.image_size
        and bool(part.pictures) == bool(first.pictures),
        "steps a second": is_same_rate(one.control_hz, other.control_hz),
    }
    if kind := next((kind for kind, is_same in same.items() if not is_same), ""):
        raise DemosError(
            f"{part.name} has other {kind} than {first.name}: learn from one kind at a time."
        )
