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

from shapechanger.demos.cloning.clone import Augmentation, CloneSettings, prepared, targets
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

    Each value comes from the index in `order`, times its sign, 1 or -1. `rightward` is 1 if a
    larger value steers to the right, -1 to the left, and 0 if neither.
    """

    order: tuple[int, ...]
    signs: tuple[float, ...]
    rightward: tuple[float, ...]

    def __call__(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the mirrored values, shape (n, size) in and out."""
        return values[:, list(self.order)] * np.asarray(self.signs, np.float32)

    def balance(self, actions: NDArray[np.float32]) -> float:
        """Return how evenly actions steer: 0 if to one side only, 1 if equally to both, or to none.

        In a drive that turns to one side only, the mirror image would teach the wrong turn.
        """
        aside = actions @ np.asarray(self.rightward, np.float32)
        right, left = float(aside.clip(min=0.0).sum()), float((-aside).clip(min=0.0).sum())
        return min(right, left) / max(right, left) if max(right, left) else 1.0


def mirror_of(layout: Layout) -> Mirror:
    """Return the mirror of a layout; DemosError if the mirror image of a feature is unknown."""
    values: list[tuple[int, float, float]] = []
    names = layout.names
    for place, feature in enumerate(layout):
        parts = set(feature.name.split("/"))
        other = _SIDE.sub(lambda found: _SIDES[found[0]], feature.name)
        if other != feature.name and other in names and not feature.shape:
            rightward = 1.0 if _SIDE.findall(feature.name) == ["right"] else -1.0
            values.append((names.index(other), 1.0, rightward))
        elif parts & _NEGATED and feature.low == -feature.high and not feature.shape:
            values.append((place, -1.0, 1.0))
        elif parts & _KEPT and not feature.shape:
            values.append((place, 1.0, 0.0))
        else:
            raise DemosError(f"the mirror image of {feature.name} is unknown")
    return Mirror(*zip(*values, strict=True))


def evaluated_steps(episodes: Sequence[int], by: SplitBy, share: float) -> NDArray[np.bool_]:
    """Return a mask of the steps to hold out to evaluate a policy on: the last share, in [0, 1).

    `episodes` are lengths. By "time", the share is of all steps; by "episode", unless the share is
    0, the fewest last episodes that have at least the share are held out, but never all episodes.
    """
    if not 0.0 <= share < 1.0:
        raise DemosError(f"The held-out share must be in [0, 1), got {share}.")
    n = sum(episodes)
    last = math.floor(share * n)
    if share and by == "episode":
        ends = np.cumsum([length for length in reversed(episodes) if length])[:-1]
        if not len(ends):
            raise DemosError("There is one episode only, so none can be held out: split by time.")
        last = next((end for end in ends if end >= share * n), ends[-1])
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
    """Return randomly changed images in [0, 1], (batch, 3, height, width), and which are mirrored.

    The images with these indices, shape (batch,), are taken from `pictures`, uint8 of the shape
    (n, height, width, 3). The actions of mirrored images must be mirrored, too.
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
    gain, colour = factors(1, augmentation.gain), factors(seen.shape[1], augmentation.colour)
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


Plain = tuple[NDArray[np.uint8] | None, NDArray[np.float32] | None, NDArray[Any]]
"""Examples without augmentation: prepared images, states and targets."""

Batch = tuple[Tensor | None, Tensor | None, Tensor]
"""Examples of one training step: images in [0, 1], (batch, 3, height, width), states, (batch, k),
and targets, (batch, m), or (batch,) for classes."""


class Examples(NamedTuple):
    """Prepared images, (n, height, width, 3), states, (n, 2, k), and targets of training examples.

    Targets are actions, (n, 2, m), or class indices, (n, 2); the second is mirrored, or repeated.
    """

    pictures: NDArray[np.uint8] | None
    states: NDArray[np.float32] | None
    targets: NDArray[Any]

    @classmethod
    def of(
        cls, data: Dataset, card: PolicyCard, mirrors: tuple[Mirror | None, Mirror | None]
    ) -> Examples:
        """Return demonstrations as the policy of a card sees and learns them.

        `mirrors` are of actions and states; None repeats the examples themselves.
        """
        pictures, states = prepared(card, data.pictures, data.states)
        if pictures is not None:  # PyTorch does not accept read-only arrays.
            pictures = np.require(pictures, requirements=["C", "W"])
        of_actions, of_states = mirrors
        if states is not None:
            states = np.stack((states, of_states(states) if of_states else states), axis=1)
        both = data.actions, of_actions(data.actions) if of_actions else data.actions
        return cls(pictures, states, np.stack([targets(card.network, x) for x in both], axis=1))

    def plain(self, which: NDArray[np.bool_]) -> Plain:
        """Return the examples selected by a mask of shape (n,), without their mirror images."""
        pictures = None if self.pictures is None else self.pictures[which]
        states = None if self.states is None else self.states[which, 0]
        return pictures, states, self.targets[which, 0]

    def draw(self, few: Tensor, augmentation: Augmentation, generator: torch.Generator) -> Batch:
        """Return the examples with these indices, augmented."""
        if self.pictures is None:
            seen, turned = None, torch.rand(len(few), generator=generator) < augmentation.mirror
        else:
            pictures = torch.as_tensor(self.pictures)
            seen, turned = augmented(pictures, few, augmentation, generator)
        states = None if self.states is None else torch.as_tensor(self.states)[few, turned.long()]
        return seen, states, torch.as_tensor(self.targets)[few, turned.long()]


def batches(
    shown: Examples,
    learned: NDArray[np.bool_],
    rehearsal: Examples | None,
    settings: CloneSettings,
    seed: int,
) -> Iterator[Batch]:
    """Yield batches forever, of the examples in a mask, shape (n,), and of a rehearsal.

    Each example is drawn once before any repeats.
    """
    generator = torch.Generator().manual_seed(seed)
    again = 0 if rehearsal is None else round(settings.rehearsal * settings.batch)
    sources = [(shown, _shuffled(np.flatnonzero(learned), settings.batch - again, generator))]
    if rehearsal is not None and again:
        sources.append((rehearsal, _shuffled(np.arange(len(rehearsal.targets)), again, generator)))
    while True:
        parts = [few.draw(next(order), settings.augmentation, generator) for few, order in sources]
        columns: Any = zip(*parts, strict=True)
        joined: Any = (None if few[0] is None else torch.cat(few) for few in columns)
        yield tuple(joined)


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
