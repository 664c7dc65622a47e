"""Demonstrations as arrays to learn from."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
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
from shapechanger.errors import DemosError, MissingExtra, UnknownName
from shapechanger.layout import Layout

try:
    import simplejpeg
except ImportError as error:
    raise MissingExtra("simplejpeg", "data") from error

__all__ = ["LARGEST_PICTURE", "Dataset", "count_steps", "decode_picture", "load_dataset"]

LARGEST_PICTURE: Final = 4096 * 4096
"""Pixels of the largest picture that is decoded; a file that claims more is damaged, or a trap."""

_NS_PER_S: Final = 1e9
# Two recorders of 20 Hz write 20 and 20.000001.
_SAME_RATE: Final = 0.01

Shrink = Callable[[NDArray[np.uint8]], NDArray[np.uint8]]
"""Makes of a picture, (H, W, 3), what is kept of it."""


@dataclass(frozen=True)
class Dataset:
    """What was seen and decided, step by step, of one or more episodes.

    Attributes:
        pictures: Red, green and blue, shape (n, H, W, 3); None without pictures.
        states: Shape (n, k), NaN where nothing measured a number; None without states.
        actions: What was decided, shape (n, m), in the order of the layout.
        episodes: How many steps each episode has, in order; none of them 0.
        times_s: When each step was, s since the start of its episode, shape (n,).
        files: Where each step comes from, for people to read.
        action_layout: What the numbers of an action mean.
        state_layout: What those of a state mean; None without states.
        control_hz: Steps a second.
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

    def __len__(self) -> int:
        """How many steps there are."""
        return len(self.actions)

    def __repr__(self) -> str:
        """Shapes, and not arrays."""
        seen = "no pictures" if self.pictures is None else f"pictures {self.pictures.shape[1:]}"
        return f"Dataset({len(self)} steps of {len(self.episodes)} episodes, {seen})"


def load_dataset(
    data: Path,
    *,
    drivers: Collection[str] = ("person", "expert"),
    shrink: Shrink | None = None,
) -> Dataset:
    """Read demonstrations, whatever format they have.

    Steps that were dropped are left out, and so is what others than the drivers did.

    Args:
        data: A recording, one episode of it, or anything that `shapechanger demos import` reads,
            which is not changed.
        drivers: Whose steps to learn from.
        shrink: What is kept of a picture, to save memory; None for all of it.

    Raises:
        DemosError: If there is nothing, or it does not go together.
        UnknownName: If there is no such driver.
    """
    for driver in drivers:
        if driver not in DRIVERS:
            raise UnknownName("driver", driver, DRIVERS)
    parts = [part for part in _parts(data, drivers, shrink) if part.actions]
    if not parts:
        raise DemosError(f"There is no step of {' or '.join(sorted(drivers))} in {data}.")
    _require_same(parts)
    first = parts[0]
    pictures = [picture for part in parts for picture in part.pictures]
    states = [state for part in parts for state in part.states]
    return Dataset(
        pictures=np.stack(pictures) if pictures else None,
        states=np.array(states, np.float32) if first.header.state_layout else None,
        actions=np.array([action for part in parts for action in part.actions], np.float32),
        episodes=tuple(len(part.actions) for part in parts),
        times_s=np.concatenate([part.times_s() for part in parts]),
        files=tuple(file for part in parts for file in part.files),
        action_layout=Layout.from_json(first.header.action_layout),
        state_layout=_layout(first.header.state_layout),
        control_hz=first.header.control_hz,
    )


def count_steps(data: Path, *, drivers: Collection[str] = ("person", "expert")) -> int:
    """How many steps `load_dataset` would give, without looking at a picture; errors as there."""
    return sum(step.driver in drivers for _, _, steps in _episodes(data) for step, _ in steps)


def decode_picture(jpeg: bytes, name: str) -> NDArray[np.uint8]:
    """The pixels of a picture, shape (H, W, 3).

    Args:
        jpeg: Its bytes.
        name: Where it is, for the error.

    Raises:
        DemosError: If it is no whole JPEG, or claims to be huge.
    """
    try:
        height, width, _, _ = simplejpeg.decode_jpeg_header(jpeg)
        if height * width > LARGEST_PICTURE:
            raise DemosError(
                f"{name} says that it has {width} x {height} pixels: more than {LARGEST_PICTURE} "
                "are not read."
            )
        # Strict refuses what a decoder would fill up with grey.
        return simplejpeg.decode_jpeg(jpeg, colorspace="RGB", strict=True)
    except ValueError as error:
        if isinstance(error, DemosError):
            raise
        raise DemosError(f"{name} is no whole picture: {error}.") from error


class _Part(NamedTuple):
    """One episode."""

    name: str
    header: EpisodeHeader
    pictures: list[NDArray[np.uint8]]
    states: list[tuple[float, ...]]
    actions: list[tuple[float, ...]]
    captured: list[int | None]
    indices: list[int]
    files: list[str]

    def times_s(self) -> NDArray[np.float64]:
        """When each step was; by the rate where no clock was read."""
        known = [ns for ns in self.captured if ns is not None]
        if len(known) < len(self.captured):
            return (np.array(self.indices) - self.indices[0]) / self.header.control_hz
        times_s = (np.array(known, np.int64) - known[0]) / _NS_PER_S
        if (np.diff(times_s) < 0.0).any():
            worst = int(np.diff(times_s).argmin())
            raise DemosError(
                f"Time runs backwards in {self.name}, after step {self.indices[worst]}: "
                "`shapechanger demos bad` leaves steps out."
            )
        return times_s


def _parts(data: Path, drivers: Collection[str], shrink: Shrink | None) -> Iterator[_Part]:
    """Each episode, in order."""
    for name, header, steps in _episodes(data):
        part = _Part(name, header, [], [], [], [], [], [])
        newest: bytes | None = None
        decoded: bytes | None = None
        pixels = np.empty((0, 0, 3), np.uint8)
        for step, jpeg in steps:
            newest = jpeg or newest
            if step.driver not in drivers:
                continue
            if newest is not None:
                if newest is not decoded and newest != decoded:
                    pixels = _pixels(part, newest, f"{name}/{step.frame or step.index}", shrink)
                    decoded = newest
                part.pictures.append(pixels)
            part.states.append(step.state)
            part.actions.append(step.action)
            part.captured.append(step.captured_ns)
            part.indices.append(step.index)
            part.files.append(f"{name}, step {step.index}")
        if len(part.pictures) not in {0, len(part.actions)}:
            raise DemosError(f"Of {name} only some steps have pictures.")
        yield part


_Episode = tuple[str, EpisodeHeader, Iterator[tuple[Step, bytes | None]]]


def _episodes(data: Path) -> Iterator[_Episode]:
    """Name, header, and each step that counts with its picture, of each episode."""
    if not data.exists() or _is_ours(data):
        for path in episodes_of(data):
            episode = read_episode(path)
            kept = ((step, episode.jpeg(step)) for step in episode.kept)
            yield str(path), episode.header, kept
        return
    from shapechanger.demos.exchange import import_episodes

    for number, (header, steps) in enumerate(import_episodes(data)):
        yield f"{data}, episode {number}", header, iter(steps)


def _is_ours(data: Path) -> bool:
    return data.is_dir() and (is_episode(data) or any(is_episode(p) for p in data.iterdir()))


def _pixels(part: _Part, jpeg: bytes, where: str, shrink: Shrink | None) -> NDArray[np.uint8]:
    """What is kept of a picture.

    Raises:
        DemosError: If it is none, or has another size than the header says.
    """
    pixels = decode_picture(jpeg, where)
    size = pixels.shape[1], pixels.shape[0]
    if part.header.image_size not in {None, size}:
        wide, high = part.header.image_size or size
        raise DemosError(
            f"{where} has {size[0]} x {size[1]} pixels, and the other pictures {wide} x {high}."
        )
    return pixels if shrink is None else shrink(pixels)


def _require_same(parts: list[_Part]) -> None:
    """Refuse episodes that do not go together.

    Raises:
        DemosError: If one differs from the first, and in what.
    """
    first = parts[0]
    for part in parts[1:]:
        ratio = part.header.control_hz / first.header.control_hz
        differences = {
            "actions": part.header.action_layout == first.header.action_layout,
            "states": part.header.state_layout == first.header.state_layout,
            "pictures": part.header.image_size == first.header.image_size
            and bool(part.pictures) == bool(first.pictures),
            "steps a second": abs(ratio - 1.0) < _SAME_RATE,
        }
        for what, same in differences.items():
            if not same:
                raise DemosError(
                    f"{part.name} has other {what} than {first.name}: learn from one kind at a "
                    "time."
                )


def _layout(text: str) -> Layout | None:
    return Layout.from_json(text) if text else None
