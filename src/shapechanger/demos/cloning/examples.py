"""Training examples: mirror images, held-out splits, and batches with random changes."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Literal, NamedTuple, cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from shapechanger.demos.cloning.pictures import CloningError, Framing, prepare
from shapechanger.demos.cloning.settings import Augmentation, CloneSettings
from shapechanger.layout import Layout

# Parts of names, between slashes. In the mirror image, the first change their sign and the second
# do not. Positive yaw is to the left, and y points to the left.
_NEGATED: Final = frozenset({"steering", "bearing", "yaw_rate", "acceleration_y"})
_KEPT: Final = frozenset(
    {"throttle", "forward", "backward", "speed", "distance", "acceleration_x"}
    | {"bump", "stall", "collision", "battery", "temperature"}
)
_SIDES: Final = {"left": "right", "right": "left"}
_SIDE: Final = re.compile(r"(?<![a-z])(left|right)(?![a-z])")
_ROUNDING: Final = 1e-5  # Of actions in single precision.

SplitBy = Literal["time", "episode"]
"""Hold out the end of the recording by time, or whole episodes."""


@dataclass(frozen=True, slots=True)
class Mirror:
    """Effect of mirroring the world on the values of a layout.

    Attributes:
        order: Index of the value that each value comes from.
        signs: Sign of each value, 1 or -1.
        rightward: 1 if a larger value steers to the right, -1 to the left, 0 neither.
    """

    order: tuple[int, ...]
    signs: tuple[float, ...]
    rightward: tuple[float, ...]

    def __call__(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the mirrored values, shape (n, size) in and out."""
        return values[:, list(self.order)] * np.asarray(self.signs, np.float32)

    def balance(self, actions: NDArray[np.float32]) -> float:
        """Return how evenly actions steer to both sides: 0 for one side only, 1 for equal shares.

        In a drive that turns to one side only, the mirror image would teach the wrong turn.
        """
        aside = actions @ np.asarray(self.rightward, np.float32)
        right, left = float(aside.clip(min=0.0).sum()), float((-aside).clip(min=0.0).sum())
        return min(right, left) / max(right, left) if max(right, left) else 1.0


STEERING: Final = Mirror((0, 1), (-1.0, 1.0), (1.0, 0.0))
"""Mirror of steering and throttle."""


def mirror_of(layout: Layout) -> Mirror:
    """Return the mirror of a layout: steering changes its sign, left and right are swapped."""
    values: list[tuple[int, float, float]] = []
    names = layout.names
    for place, feature in enumerate(layout):
        parts = set(feature.name.split("/"))
        other = _SIDE.sub(lambda found: _SIDES[found[0]], feature.name)
        if feature.shape:
            raise CloningError(f"the mirror image of the array {feature.name} is unknown")
        if other != feature.name and other in names:
            rightward = 1.0 if _SIDE.findall(feature.name) == ["right"] else -1.0
            values.append((names.index(other), 1.0, rightward))
        elif parts & _NEGATED and feature.low == -feature.high:
            values.append((place, -1.0, 1.0))
        elif parts & _KEPT:
            values.append((place, 1.0, 0.0))
        else:
            raise CloningError(f"the mirror image of {feature.name} is unknown")
    return Mirror(*zip(*values, strict=True))


@dataclass(frozen=True, slots=True)
class Examples:
    """Training examples, with their mirror images.

    Attributes:
        pictures: Prepared images, shape (n, height, width, 3); None for none.
        states: Shape (n, k); None for none.
        targets: Target outputs: actions, shape (n, m), or class indices, shape (n,).
        mirrored_states: The mirrored states.
        mirrored_targets: The mirrored targets.
    """

    pictures: NDArray[np.uint8] | None
    states: NDArray[np.float32] | None
    targets: NDArray[Any]
    mirrored_states: NDArray[np.float32] | None
    mirrored_targets: NDArray[Any]

    def __len__(self) -> int:
        """Return the number of examples."""
        return len(self.targets)

    def part(self, which: NDArray[np.bool_]) -> Examples:
        """Return the examples selected by a mask of shape (n,)."""
        arrays = {name: getattr(self, name) for name in self.__slots__}
        return replace(
            self, **{n: array[which] for n, array in arrays.items() if array is not None}
        )


def steering_examples(
    pictures: NDArray[np.uint8], actions: NDArray[np.floating], framing: Framing
) -> Examples:
    """Return examples of steering and throttle from images.

    Args:
        pictures: Shape (n, H, W, 3), raw or prepared.
        actions: Shape (n, 2), in [-1, 1].
        framing: Crop and resolution.
    """
    if actions.ndim != 2 or actions.shape[1] != 2:
        raise CloningError(
            f"Actions must be steering and throttle, shape (n, 2), got shape {actions.shape}."
        )
    if len(pictures) != len(actions):
        raise CloningError(
            f"Each image needs an action: there are {len(pictures)} images and "
            f"{len(actions)} actions."
        )
    if not len(actions):
        raise CloningError("There is no image to learn from.")
    wrong = ~(np.abs(actions) <= 1.0 + _ROUNDING).all(axis=1)  # Also finds NaN.
    if wrong.any():
        first = int(wrong.argmax())
        raise CloningError(
            f"Steering and throttle must be in [-1, 1], but action {first} is "
            f"{actions[first].tolist()}."
        )
    wanted = actions.astype(np.float32)
    return Examples(prepare(pictures, framing), None, wanted, None, STEERING(wanted))


def held_out(n: int, episodes: Sequence[int], share: float) -> NDArray[np.bool_]:
    """Return a mask of the examples to hold out: the last ones of each episode.

    The last ones are taken because neighbours in time look the same: an image between two training
    images would test nothing.

    Args:
        n: Number of examples.
        episodes: Length of each episode in order; () for a single one.
        share: Share of each episode, in [0, 1); rounded down.

    Raises:
        CloningError: If the lengths do not add up to n.
    """
    lengths = list(episodes) or [n]
    if min(lengths) < 0 or sum(lengths) != n:
        raise CloningError(
            f"The episodes have {sum(lengths)} images in total, but there are {n} images."
        )
    mask = np.zeros(n, np.bool_)
    end = 0
    for length in lengths:
        end += length
        mask[end - math.floor(share * length) : end] = True
    return mask


def evaluated_steps(episodes: Sequence[int], by: SplitBy, share: float) -> NDArray[np.bool_]:
    """Return a mask of the steps to hold out to evaluate a policy on: the last ones.

    Args:
        episodes: Number of steps of each episode, in order.
        by: "time" takes the last share of all steps; "episode" takes whole episodes from the end
            until they have that share, but at least one, and leaves at least one.
        share: Share of the steps, in [0, 1).

    Returns:
        Shape (sum(episodes),).

    Raises:
        CloningError: If the share is out of range, or there is one episode only.
    """
    if not 0.0 <= share < 1.0:
        raise CloningError(f"The held-out share must be in [0, 1), got {share}.")
    n = sum(episodes)
    mask = np.zeros(n, np.bool_)
    if not share:
        return mask
    if by == "time":
        mask[n - math.floor(share * n) :] = True
        return mask
    lengths = [length for length in episodes if length]
    if len(lengths) < 2:
        raise CloningError(
            "There is one episode only, so none can be held out: split by time instead of episode."
        )
    last = 0
    for length in reversed(lengths[1:]):
        if last and last >= share * n:
            break
        last += length
    mask[n - last :] = True
    return mask


def stretch(n: int, member: int, members: int, share: float) -> NDArray[np.bool_]:
    """Return a mask of the steps with which a member decides when to stop.

    Args:
        n: Number of training steps.
        member: Index of the member.
        members: Number of members; the last one takes the end.
        share: Length of the stretch as a share of n, in [0, 1); at most n / (members + 1) steps.

    Returns:
        Shape (n,).
    """
    length = min(math.floor(share * n), n // (members + 1))
    start = round((n - length) * (member + 1) / members)
    mask = np.zeros(n, np.bool_)
    mask[start : start + length] = True
    return mask


_BRIGHTEST: Final = 255.0


def plain(pictures: Tensor, index: Tensor) -> Tensor:
    """Return images without augmentation.

    Args:
        pictures: uint8, shape (n, height, width, 3).
        index: Indices of the images, shape (batch,).

    Returns:
        Images in [0, 1], shape (batch, 3, height, width).
    """
    return scaled(pictures[index])


def scaled(pictures: Tensor) -> Tensor:
    """Return images in [0, 1], shape (n, 3, height, width), of uint8 as in `plain`."""
    return pictures.permute(0, 3, 1, 2).float() / _BRIGHTEST


def augmented(
    pictures: Tensor, index: Tensor, augmentation: Augmentation, generator: torch.Generator
) -> tuple[Tensor, Tensor]:
    """Return images with random changes of light, colour, noise and position.

    Args:
        pictures: uint8, shape (n, height, width, 3).
        index: Indices of the images, shape (batch,).
        augmentation: Kind and extent of the changes.
        generator: Source of randomness.

    Returns:
        Images in [0, 1], shape (batch, 3, height, width), and a mask of the mirrored ones, whose
        actions must be mirrored too, shape (batch,).
    """
    mirrored = torch.rand(len(index), generator=generator) < augmentation.mirror
    seen = _moved(pictures, index, mirrored, augmentation.shift, generator)
    _change_light(seen, augmentation, generator)
    _blur(seen, augmentation.blurred, generator)
    _add_noise(seen, augmentation, generator)
    return seen.clamp_(0.0, 1.0), mirrored


def _moved(
    pictures: Tensor, index: Tensor, mirrored: Tensor, shift: int, generator: torch.Generator
) -> Tensor:
    """Mirror and shift while fetching, with one look-up per pixel; edge pixels are repeated."""
    height, width = pictures.shape[1], pictures.shape[2]
    moves = torch.randint(-shift, shift + 1, (2, len(index), 1), generator=generator)
    rows = (torch.arange(height) + moves[0]).clamp_(0, height - 1)
    columns = (torch.arange(width) + moves[1]).clamp_(0, width - 1)
    columns = torch.where(mirrored[:, None], width - 1 - columns, columns)
    places = (index[:, None, None] * height + rows[:, :, None]) * width + columns[:, None, :]
    pixels = pictures.reshape(-1, pictures.shape[3]).index_select(0, places.reshape(-1))
    # Colours stay last in memory, which is fastest for the network.
    return pixels.reshape(*places.shape, -1).permute(0, 3, 1, 2).float().div_(_BRIGHTEST)


def _change_light(seen: Tensor, augmentation: Augmentation, generator: torch.Generator) -> None:
    """Change brightness and colour."""
    n, colours = seen.shape[0], seen.shape[1]
    gain = _factors((n, 1, 1, 1), augmentation.gain, generator)
    colour = _factors((n, colours, 1, 1), augmentation.colour, generator)
    offset = augmentation.offset * (2.0 * torch.rand((n, 1, 1, 1), generator=generator) - 1.0)
    seen.mul_(gain * colour).add_(offset)


def _factors(shape: tuple[int, ...], largest: float, generator: torch.Generator) -> Tensor:
    """Return factors between 1 / largest and largest, uniform in their logarithm."""
    spread = 2.0 * torch.rand(shape, generator=generator) - 1.0
    return torch.exp(math.log(largest) * spread)


def _blur(seen: Tensor, share: float, generator: torch.Generator) -> None:
    """Blur the first few images; a batch is in random order."""
    if count := _random_count(len(seen), share, generator):
        seen[:count] = functional.avg_pool2d(seen[:count], 3, 1, 1, count_include_pad=False)


def _add_noise(seen: Tensor, augmentation: Augmentation, generator: torch.Generator) -> None:
    """Add noise as of a camera in the dark to the last few images; some are blurred and noisy."""
    if count := _random_count(len(seen), augmentation.noisy, generator):
        strength = augmentation.noise * torch.rand((count, 1, 1, 1), generator=generator)
        last = seen[-count:]
        last.add_(strength * torch.randn(last.shape, generator=generator))


def _random_count(n: int, share: float, generator: torch.Generator) -> int:
    """Return a number of images that is right on average even for small batches."""
    return math.floor(n * share + float(torch.rand((), generator=generator)) * (share > 0.0))


class Batch(NamedTuple):
    """Examples of one training step.

    Attributes:
        pictures: In [0, 1], shape (batch, 3, height, width); None for none.
        states: Shape (batch, k); None for none.
        targets: Shape (batch, m), or (batch,) for classes.
    """

    pictures: Tensor | None
    states: Tensor | None
    targets: Tensor


class Batches:
    """Infinite batches of augmented examples, each drawn once before any repeats.

    Args:
        shown: The examples.
        learned: Mask of those to learn from, shape (n,).
        rehearsal: Examples to mix in; None for none.
        settings: Batch size, share of the rehearsal, and augmentation.
        seed: Seed of order and augmentation.
    """

    def __init__(
        self,
        shown: Examples,
        learned: NDArray[np.bool_],
        rehearsal: Examples | None,
        settings: CloneSettings,
        seed: int,
    ) -> None:
        self._generator = torch.Generator().manual_seed(seed)
        self._settings = settings
        again = 0 if rehearsal is None else round(settings.rehearsal * settings.batch)
        self._sources = [_Source(shown, np.flatnonzero(learned), settings.batch - again)]
        if rehearsal is not None and again:
            self._sources.append(_Source(rehearsal, np.arange(len(rehearsal)), again))

    @property
    def size(self) -> int:
        """Number of different examples to learn from, without the rehearsal."""
        return self._sources[0].size

    def draw(self) -> Batch:
        """Return the next batch."""
        parts = [source.draw(self._settings, self._generator) for source in self._sources]
        pictures, states, targets = (_joined(few) for few in zip(*parts, strict=True))
        return Batch(pictures, states, cast("Tensor", targets))


class _Source:
    """Examples in an order that is shuffled again whenever it ends."""

    def __init__(self, shown: Examples, index: NDArray[np.intp], at_a_time: int) -> None:
        self._pictures, self._states = _tensor(shown.pictures), _tensor(shown.states)
        self._mirrored_states = _tensor(shown.mirrored_states)
        self._targets = torch.as_tensor(shown.targets)
        self._mirrored_targets = torch.as_tensor(shown.mirrored_targets)
        self.size = len(index)
        self._index = torch.as_tensor(index)
        self._at_a_time = at_a_time
        self._waiting = self._index[:0]

    def draw(self, settings: CloneSettings, generator: torch.Generator) -> Batch:
        """Return the next examples, augmented."""
        few = self._next(generator)
        if self._pictures is None:
            share = settings.augmentation.mirror
            seen, turned = None, torch.rand(len(few), generator=generator) < share
        else:
            seen, turned = augmented(self._pictures, few, settings.augmentation, generator)
        states = None
        if self._states is not None and self._mirrored_states is not None:
            states = _select(turned, self._mirrored_states[few], self._states[few])
        return Batch(seen, states, _select(turned, self._mirrored_targets[few], self._targets[few]))

    def _next(self, generator: torch.Generator) -> Tensor:
        """Return the next indices; with too few examples, some repeat within a batch."""
        while len(self._waiting) < self._at_a_time:
            order = torch.randperm(self.size, generator=generator)
            self._waiting = torch.cat((self._waiting, self._index[order]))
        few, self._waiting = self._waiting.tensor_split([self._at_a_time])
        return few


def _select(turned: Tensor, mirrored: Tensor, plain: Tensor) -> Tensor:
    """Select the mirrored or the plain value of each row."""
    return torch.where(turned if plain.ndim == 1 else turned[:, None], mirrored, plain)


def _joined(parts: Sequence[Tensor | None]) -> Tensor | None:
    there = [part for part in parts if part is not None]
    return torch.cat(there) if len(there) > 1 else there[0] if there else None


def _tensor(values: NDArray[Any] | None) -> Tensor | None:
    # PyTorch does not accept read-only arrays, such as memory-mapped files.
    return None if values is None else torch.as_tensor(np.require(values, requirements=["C", "W"]))
