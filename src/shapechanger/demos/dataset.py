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

from shapechanger.demos.episodes import DRIVERS, EpisodeHeader, Step, episodes_of, read_episode
from shapechanger.demos.episodes.records import is_episode, is_same_rate, rate_jitter
from shapechanger.demos.exchange import import_episodes
from shapechanger.demos.jpeg import decode_picture
from shapechanger.errors import DemosError, require_known
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
        times_s: Time of each step since the first loaded step of its episode, s, shape (n,).
        files: Origin of each step, for people to read; () if unknown.
        action_layout: Meaning of the values of an action.
        state_layout: Meaning of the values of a state; None without states.
        control_hz: Steps per second.
        body: Kind of robot of the first episode, such as "car"; "" if unknown.
        rate_jitter: How far the rate varied, as a share of it; see `episodes.records.rate_jitter`.
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
        lengths = np.asarray(self.episodes)
        ends = np.cumsum(lengths)
        driven = self.times_s[ends - 1] - self.times_s[ends - lengths]
        return float(driven.sum()) + len(ends) / self.control_hz

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
    data: Path, *, drivers: Collection[str] = DEMONSTRATORS, shrink: Shrink | None = None
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
    require_known("driver", DRIVERS, *drivers)
    parts: list[Dataset] = []
    first: tuple[str, dict[str, Any]] | None = None
    periods_s: list[float] = []
    for name, header, steps in _episodes(data):
        part, periods = _part(name, header, steps, drivers, shrink)
        if part is None:
            continue
        kind = {"actions": part.action_layout, "states": part.state_layout}
        kind |= {"pictures": (header.image_size, part.pictures is None)}
        first = first or (name, kind)
        other = [name for name, value in kind.items() if first[1][name] != value]
        parts.append(part)
        periods_s += periods
        if not is_same_rate(header.control_hz, parts[0].control_hz):
            other.append("steps a second")
        if other:
            raise DemosError(
                f"{name} has other {other[0]} than {first[0]}: learn from one kind at a time."
            )
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


def _part(
    name: str,
    header: EpisodeHeader,
    steps: Iterator[_StepAndImage],
    drivers: Collection[str],
    shrink: Shrink | None,
) -> tuple[Dataset | None, list[float]]:
    """Return the steps of some drivers, None without any, and the known times between steps, s."""
    chosen: list[Step] = []
    pictures: list[NDArray[np.uint8]] = []
    newest = decoded = None
    for step, jpeg in steps:
        newest = jpeg or newest
        if step.driver not in drivers:
            continue
        chosen.append(step)
        if newest is None:
            continue
        if newest == decoded:  # The previous step has the same frame.
            pictures.append(pictures[-1])
            continue
        decoded, where = newest, f"{name}/{step.frame or step.index}"
        pixels = decode_picture(newest, where)
        size = (pixels.shape[1], pixels.shape[0])
        if header.image_size not in {None, size}:
            raise DemosError(f"{where} has {size} pixels, but the header {header.image_size}.")
        pictures.append(pixels if shrink is None else shrink(pixels, header))
    if not chosen:
        return None, []
    if len(pictures) not in {0, len(chosen)}:
        raise DemosError(f"Only some steps of {name} have images.")
    indices = np.array([step.index for step in chosen])
    times_s, periods_s = (indices - indices[0]) / header.control_hz, list[float]()
    known = [step.captured_ns for step in chosen if step.captured_ns is not None]
    if len(known) == len(chosen):  # Otherwise the times are computed from the rate.
        times_s = (np.array(known, np.int64) - known[0]) / 1e9
        apart = np.diff(times_s)
        if (apart < 0.0).any():
            raise DemosError(
                f"Time runs backwards in {name} after step {indices[apart.argmin()]}: exclude "
                "steps with `shapechanger demos edit bad`."
            )
        periods_s = apart[np.diff(indices) == 1].tolist()
    layout = header.state_layout or None
    part = Dataset(
        pictures=np.stack(pictures) if pictures else None,
        states=np.array([step.state for step in chosen], np.float32) if layout else None,
        actions=np.array([step.action for step in chosen], np.float32),
        episodes=(len(chosen),),
        times_s=times_s,
        files=tuple(f"{name}, step {step.index}" for step in chosen),
        action_layout=header.action_layout,
        state_layout=layout,
        control_hz=header.control_hz,
        body=header.body,
    )
    return part, periods_s
