"""Demonstrations as arrays to learn from."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import compress
from pathlib import Path
from typing import Any, Final

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from shapechanger.demos.episodes import (
    DRIVERS,
    EpisodeHeader,
    Step,
    episodes_of,
    read_episode,
)
from shapechanger.demos.episodes.records import is_episode
from shapechanger.demos.exchange import import_episodes
from shapechanger.demos.jpeg import decode_picture
from shapechanger.demos.statistics import is_same_rate, rate_jitter
from shapechanger.errors import DemosError, UnknownName
from shapechanger.layout import Layout

DEMONSTRATORS: Final = ("person", "expert")
"""Drivers whose steps policies are trained on."""

_StepAndImage = tuple[Step, bytes | None]

Shrink = Callable[[NDArray[np.uint8], EpisodeHeader], NDArray[np.uint8]]
"""Function that reduces an image of an episode, shape (H, W, 3), to save memory."""


@dataclass(frozen=True)
class Dataset:
    """Observations and actions of one or more episodes, step by step.

    Attributes:
        pictures: Red, green and blue, shape (n, H, W, 3); None without images.
        states: Shape (n, k), NaN for unmeasured values; None without states.
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
        seen = "no images" if self.pictures is None else f"images {self.pictures.shape[1:]}"
        return f"Dataset({len(self)} steps of {len(self.episodes)} episodes, {seen})"

    @property
    def duration_s(self) -> float:
        """Duration, s; the last step of an episode lasts one period."""
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
    """Return the steps of several datasets of one kind, with other attributes from the first."""

    def joined(name: str) -> Any:
        arrays = [getattr(data, name) for data in datasets]
        return None if arrays[0] is None else np.concatenate(arrays)

    return replace(
        datasets[0],
        **{name: joined(name) for name in ("pictures", "states", "actions", "times_s")},
        episodes=tuple(length for data in datasets for length in data.episodes),
        files=tuple(file for data in datasets for file in data.files),
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
    parts: list[Dataset] = []
    kinds: list[tuple[str, dict[str, object], float]] = []
    periods_s: list[float] = []
    for name, header, steps in _episodes(data):
        chosen, pictures = _chosen(name, header, steps, drivers, shrink)
        if not chosen:
            continue
        kind: dict[str, object] = {"actions": header.action_layout, "states": header.state_layout}
        kind["pictures"] = (header.image_size, bool(pictures))
        kinds.append((name, kind, header.control_hz))
        other = [what for what, value in kinds[0][1].items() if kind[what] != value]
        if not is_same_rate(header.control_hz, kinds[0][2]):
            other.append("steps a second")
        if other:
            raise DemosError(
                f"{name} has other {other[0]} than {kinds[0][0]}: learn from one kind at a time."
            )
        times_s, are_known = _times_s(chosen, header.control_hz, name)
        follows = np.diff([step.index for step in chosen]) == 1
        periods_s += np.diff(times_s)[follows & are_known].tolist()
        layout = Layout.from_json(header.state_layout) if header.state_layout else None
        part = Dataset(
            pictures=np.stack(pictures) if pictures else None,
            states=np.array([step.state for step in chosen], np.float32) if layout else None,
            actions=np.array([step.action for step in chosen], np.float32),
            episodes=(len(chosen),),
            times_s=times_s,
            files=tuple(f"{name}, step {step.index}" for step in chosen),
            action_layout=Layout.from_json(header.action_layout),
            state_layout=layout,
            control_hz=header.control_hz,
            body=header.body,
        )
        parts.append(part)
    if not parts:
        raise DemosError(f"There is no step of {' or '.join(sorted(drivers))} in {data}.")
    return replace(merged(parts), rate_jitter=rate_jitter(periods_s, parts[0].control_hz))


def count_steps(data: Path) -> int:
    """Count the steps that `load_dataset` would load by default, without decoding any image."""
    return sum(step.driver in DEMONSTRATORS for _, _, steps in _episodes(data) for step, _ in steps)


def _episodes(data: Path) -> Iterator[tuple[str, EpisodeHeader, Iterator[_StepAndImage]]]:
    """Yield the name, the header, and the kept steps with their images, of each episode."""
    if not data.exists() or any(map(is_episode, (data, *data.glob("*")))):
        for path in episodes_of(data):
            episode = read_episode(path)
            steps = ((step, episode.jpeg(step)) for step in episode.kept)
            yield str(path), episode.header, steps
        return
    for number, found in enumerate(import_episodes(data)):
        kept = enumerate(record for record in found.records if record.dropped is None)
        steps = ((structs.replace(one.step, index=n), one.jpeg) for n, one in kept)
        yield f"{data}, episode {number}", found.header, steps


def _chosen(
    name: str,
    header: EpisodeHeader,
    steps: Iterator[_StepAndImage],
    drivers: Collection[str],
    shrink: Shrink | None,
) -> tuple[list[Step], list[NDArray[np.uint8]]]:
    """Return the steps of some drivers, each with its image if there are any."""
    chosen: list[Step] = []
    pictures: list[NDArray[np.uint8]] = []
    newest = decoded = None
    pixels = np.empty((0, 0, 3), np.uint8)
    for step, jpeg in steps:
        newest = jpeg or newest
        if step.driver not in drivers:
            continue
        chosen.append(step)
        if newest is None:
            continue
        if newest is not decoded and newest != decoded:
            decoded, where = newest, f"{name}/{step.frame or step.index}"
            pixels = decode_picture(newest, where)
            size = (pixels.shape[1], pixels.shape[0])
            if header.image_size not in {None, size}:
                raise DemosError(f"{where} has {size} pixels, but the header {header.image_size}.")
            pixels = pixels if shrink is None else shrink(pixels, header)
        pictures.append(pixels)
    if len(pictures) not in {0, len(chosen)}:
        raise DemosError(f"Only some steps of {name} have images.")
    return chosen, pictures


def _times_s(steps: Sequence[Step], hz: float, name: str) -> tuple[NDArray[np.float64], bool]:
    """Return the time of each step, s, and whether all times were recorded.

    If not, times are computed from the rate.
    """
    indices = np.array([step.index for step in steps])
    known = [step.captured_ns for step in steps if step.captured_ns is not None]
    if len(known) < len(steps):
        return (indices - indices[0]) / hz, False
    times_s = (np.array(known, np.int64) - known[0]) / 1e9
    if (np.diff(times_s) < 0.0).any():
        raise DemosError(
            f"Time runs backwards in {name} after step {indices[np.diff(times_s).argmin()]}: "
            "exclude steps with `shapechanger demos bad`."
        )
    return times_s, True
