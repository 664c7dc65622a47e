"""Training examples: mirror images, held-out splits, and batches with random changes."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from shapechanger.demos.cloning.clone import (
    Augmentation,
    CloneSettings,
    prepared,
    targets,
)
from shapechanger.demos.cloning.network import BRIGHTEST
from shapechanger.errors import DemosError
from shapechanger.layout import Layout
from shapechanger.policy import PolicyCard

if TYPE_CHECKING:
    from shapechanger.demos.dataset import Dataset

# Parts of names, between slashes. In the mirror image, the values of the first set change their
# sign, and those of the second set do not. Positive yaw is to the left, and y points to the left.
_NEGATED: Final = frozenset({"steering", "bearing", "yaw_rate", "acceleration_y"})
_KEPT: Final = frozenset(
    {"throttle", "forward", "backward", "speed", "distance", "acceleration_x"}
    | {"bump", "stall", "collision", "battery", "temperature"}
)
_SIDES: Final = {"left": "right", "right": "left"}
_SIDE: Final = re.compile(r"(?<![a-z])(left|right)(?![a-z])")

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


def mirror_of(layout: Layout) -> Mirror:
    """Return the mirror of a layout: steering changes its sign, left and right are swapped."""
    values: list[tuple[int, float, float]] = []
    names = layout.names
    for place, feature in enumerate(layout):
        parts = set(feature.name.split("/"))
        other = _SIDE.sub(lambda found: _SIDES[found[0]], feature.name)
        if feature.shape:
            raise DemosError(f"the mirror image of the array {feature.name} is unknown")
        if other != feature.name and other in names:
            rightward = 1.0 if _SIDE.findall(feature.name) == ["right"] else -1.0
            values.append((names.index(other), 1.0, rightward))
        elif parts & _NEGATED and feature.low == -feature.high:
            values.append((place, -1.0, 1.0))
        elif parts & _KEPT:
            values.append((place, 1.0, 0.0))
        else:
            raise DemosError(f"the mirror image of {feature.name} is unknown")
    return Mirror(*zip(*values, strict=True))


def evaluated_steps(episodes: Sequence[int], by: SplitBy, share: float) -> NDArray[np.bool_]:
    """Return a mask of the steps to hold out to evaluate a policy on: the last ones.

    Args:
        episodes: Number of steps of each episode, in order.
        by: "time" takes the last share of all steps; "episode" takes whole episodes from the end
            until they have that share, but at least one, and leaves at least one.
        share: Share of the steps, in [0, 1).

    Raises:
        DemosError: If the share is out of range, or there is one episode only.
    """
    if not 0.0 <= share < 1.0:
        raise DemosError(f"The held-out share must be in [0, 1), got {share}.")
    n = sum(episodes)
    last = math.floor(share * n)
    if share and by == "episode":
        lengths = [length for length in episodes if length]
        if len(lengths) < 2:
            raise DemosError(
                "There is one episode only, so none can be held out: split by time instead of "
                "episode."
            )
        last = 0
        for length in reversed(lengths[1:]):
            if last and last >= share * n:
                break
            last += length
    return np.arange(n) >= n - last


def stretch(n: int, member: int, members: int, share: float) -> NDArray[np.bool_]:
    """Return a mask of the steps, out of n, that a member uses for early stopping.

    The stretch is a share of n, in [0, 1), but at most n / (members + 1) steps; the last member
    takes the end.
    """
    length = min(math.floor(share * n), n // (members + 1))
    start = round((n - length) * (member + 1) / members)
    return (np.arange(n) >= start) & (np.arange(n) < start + length)


def augmented(
    pictures: Tensor, index: Tensor, augmentation: Augmentation, generator: torch.Generator
) -> tuple[Tensor, Tensor]:
    """Return images with random changes of light, colour, noise and position.

    Args:
        pictures: uint8, shape (n, height, width, 3).
        index: Indices of the images, shape (batch,), in random order.
        augmentation: Kind and extent of the changes.
        generator: Source of randomness.

    Returns:
        Images in [0, 1], shape (batch, 3, height, width), and a mask of the mirrored ones, whose
        actions must be mirrored too, shape (batch,).
    """
    n = len(index)

    def uniform(*shape: int) -> Tensor:
        return torch.rand(shape, generator=generator)

    def factors(colours: int, largest: float) -> Tensor:
        """Return factors between 1 / largest and largest, uniform in their logarithm."""
        return torch.exp(math.log(largest) * (2.0 * uniform(n, colours, 1, 1) - 1.0))

    def count(share: float) -> int:
        """Return a number of images that is right on average even for small batches."""
        return math.floor(n * share + float(uniform()) * (share > 0.0))

    mirrored = uniform(n) < augmentation.mirror
    seen = _moved(pictures, index, mirrored, augmentation.shift, generator)
    gain = factors(1, augmentation.gain)
    colour = factors(seen.shape[1], augmentation.colour)
    offset = augmentation.offset * (2.0 * uniform(n, 1, 1, 1) - 1.0)
    seen.mul_(gain * colour).add_(offset)
    if few := count(augmentation.blurred):
        seen[:few] = functional.avg_pool2d(seen[:few], 3, 1, 1, count_include_pad=False)
    # Noise of a camera in the dark. It is added at the end of the batch, and blur at the beginning,
    # so that some images may have both.
    if few := count(augmentation.noisy):
        strength = augmentation.noise * uniform(few, 1, 1, 1)
        last = seen[-few:]
        last.add_(strength * torch.randn(last.shape, generator=generator))
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
    return pixels.reshape(*places.shape, -1).permute(0, 3, 1, 2).float().div_(BRIGHTEST)


class Batch(NamedTuple):
    """Examples of one training step.

    Attributes:
        pictures: In [0, 1], shape (batch, 3, height, width); None without images.
        states: Shape (batch, k); None without states.
        targets: Shape (batch, m), or (batch,) for classes.
    """

    pictures: Tensor | None
    states: Tensor | None
    targets: Tensor


class Examples(NamedTuple):
    """Training examples, with their mirror images.

    Attributes:
        pictures: Prepared images, shape (n, height, width, 3); None without images.
        states: Shape (n, k); None without states.
        targets: Target outputs: actions, shape (n, m), or class indices, shape (n,).
        mirrored_states: The mirrored states; None without states.
        mirrored_targets: The mirrored targets.
    """

    pictures: NDArray[np.uint8] | None
    states: NDArray[np.float32] | None
    targets: NDArray[Any]
    mirrored_states: NDArray[np.float32] | None
    mirrored_targets: NDArray[Any]

    def part(self, which: NDArray[np.bool_]) -> Examples:
        """Return the examples selected by a mask of shape (n,)."""
        arrays: Any = (None if array is None else array[which] for array in self)
        return Examples(*arrays)

    def draw(self, few: Tensor, augmentation: Augmentation, generator: torch.Generator) -> Batch:
        """Return the examples with these indices, augmented."""
        if self.pictures is None:
            seen, turned = None, torch.rand(len(few), generator=generator) < augmentation.mirror
        else:
            pictures = torch.as_tensor(self.pictures)
            seen, turned = augmented(pictures, few, augmentation, generator)

        def select(plain: NDArray[Any], mirrored: NDArray[Any]) -> Tensor:
            which = turned if plain.ndim == 1 else turned[:, None]
            return torch.where(which, torch.as_tensor(mirrored)[few], torch.as_tensor(plain)[few])

        states = None
        if self.states is not None and self.mirrored_states is not None:
            states = select(self.states, self.mirrored_states)
        return Batch(seen, states, select(self.targets, self.mirrored_targets))


def examples_of(
    data: Dataset, card: PolicyCard, mirror: Mirror | None, state_mirror: Mirror | None
) -> Examples:
    """Return demonstrations as a policy sees and learns them, with mirror images if there are any.

    Raises:
        DemosError: If the demonstrations lack an input, or an action is out of range.
    """
    net = card.network
    pictures, states = prepared(card, data.pictures, data.states)
    if pictures is not None:  # PyTorch does not accept read-only arrays.
        pictures = np.require(pictures, requirements=["C", "W"])
    return Examples(
        pictures,
        states,
        targets(net, data.actions),
        states if states is None or state_mirror is None else state_mirror(states),
        targets(net, data.actions if mirror is None else mirror(data.actions)),
    )


def batches(
    shown: Examples,
    learned: NDArray[np.bool_],
    rehearsal: Examples | None,
    settings: CloneSettings,
    seed: int,
) -> Iterator[Batch]:
    """Yield batches indefinitely, from the examples in a mask, shape (n,), and from a rehearsal.

    Images are augmented, and each example is drawn once before any repeats.
    """
    generator = torch.Generator().manual_seed(seed)
    again = 0 if rehearsal is None else round(settings.rehearsal * settings.batch)
    sources = [(shown, np.flatnonzero(learned), settings.batch - again)]
    if rehearsal is not None and again:
        sources.append((rehearsal, np.arange(len(rehearsal.targets)), again))
    orders = [(examples, _shuffled(index, few, generator)) for examples, index, few in sources]
    while True:
        parts = [
            examples.draw(next(order), settings.augmentation, generator)
            for examples, order in orders
        ]
        columns: Any = zip(*parts, strict=True)
        joined: Any = (None if few[0] is None else torch.cat(few) for few in columns)
        yield Batch(*joined)


def _shuffled(
    index: NDArray[np.intp], at_a_time: int, generator: torch.Generator
) -> Iterator[Tensor]:
    """Yield the next indices, in an order that is shuffled again whenever it ends."""
    all_of_them = torch.as_tensor(index)
    waiting = all_of_them[:0]
    while True:
        while len(waiting) < at_a_time:  # With too few examples, some repeat within a batch.
            order = torch.randperm(len(index), generator=generator)
            waiting = torch.cat((waiting, all_of_them[order]))
        few, waiting = waiting.tensor_split([at_a_time])
        yield few
