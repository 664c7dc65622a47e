"""What a driver saw and did, checked and split before anything is learned from it."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.cloning.pictures import CloningError, Framing, prepare
from shapechanger.layout import Layout

__all__ = [
    "STEERING",
    "Examples",
    "Mirror",
    "SplitBy",
    "held_out",
    "judged_steps",
    "mirror_of",
    "steering_examples",
    "stretch",
]

# Parts of a name, between slashes. Seen in the mirror, the first change their sign and the second
# stay as they are; yaw is to the left and y points to the left.
_NEGATED: Final = frozenset({"steering", "yaw_rate", "acceleration_y"})
_KEPT: Final = frozenset(
    {"throttle", "forward", "backward", "speed", "distance", "acceleration_x"}
    | {"bump", "stall", "collision", "battery", "temperature"}
)
_SIDES: Final = {"left": "right", "right": "left"}
_SIDE: Final = re.compile(r"(?<![a-z])(left|right)(?![a-z])")


@dataclass(frozen=True, slots=True)
class Mirror:
    """What becomes of the numbers of a layout when the world is mirrored.

    Attributes:
        order: For each number the place that it comes from.
        signs: For each number 1 or -1.
        rightward: For each number 1 if more of it steers to the right, -1 to the left, 0 neither.
    """

    order: tuple[int, ...]
    signs: tuple[float, ...]
    rightward: tuple[float, ...]

    def __call__(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """The mirrored numbers, shape (n, size) in and out."""
        return values[:, list(self.order)] * np.asarray(self.signs, np.float32)

    def even(self, actions: NDArray[np.float32]) -> float:
        """How evenly these actions steer to both sides: 0 for one only, 1 for as much to each.

        A drive that turns to one side only tells which way to go where there are two, and in the
        mirror it would tell the opposite.
        """
        aside = actions @ np.asarray(self.rightward, np.float32)
        right, left = float(aside.clip(min=0.0).sum()), float((-aside).clip(min=0.0).sum())
        return min(right, left) / max(right, left) if max(right, left) else 1.0


STEERING: Final = Mirror((0, 1), (-1.0, 1.0), (1.0, 0.0))
"""Of steering and throttle."""


def mirror_of(layout: Layout) -> Mirror:
    """The mirror of a layout: steering changes its sign, left and right change places.

    Raises:
        CloningError: If nothing is known of the mirror of one of its numbers.
    """
    order: list[int] = []
    signs: list[float] = []
    rightward: list[float] = []
    names = layout.names
    for place, feature in enumerate(layout):
        parts = set(feature.name.split("/"))
        other = _SIDE.sub(lambda found: _SIDES[found[0]], feature.name)
        if feature.shape:
            raise CloningError(f"nothing is known of the mirror of the block {feature.name}")
        if other != feature.name and other in names:
            order.append(names.index(other))
            signs.append(1.0)
            rightward.append(1.0 if _SIDE.findall(feature.name) == ["right"] else -1.0)
        elif parts & _NEGATED and feature.low == -feature.high:
            order.append(place)
            signs.append(-1.0)
            rightward.append(1.0)
        elif parts & _KEPT:
            order.append(place)
            signs.append(1.0)
            rightward.append(0.0)
        else:
            raise CloningError(f"nothing is known of the mirror of {feature.name}")
    return Mirror(tuple(order), tuple(signs), tuple(rightward))


# Actions in single precision may miss their bound by a rounding.
_SLACK = 1e-5


@dataclass(frozen=True, slots=True)
class Examples:
    """What was perceived, and what is to come out of it, as it is and as the mirror shows it.

    Attributes:
        pictures: As the policy sees them, shape (n, height, width, 3); None for none.
        states: Shape (n, k); None for none.
        targets: What is to come out: actions, shape (n, m), or numbers of classes, shape (n,).
        turned_states: The states in the mirror.
        turned_targets: The targets in the mirror.
    """

    pictures: NDArray[np.uint8] | None
    states: NDArray[np.float32] | None
    targets: NDArray[Any]
    turned_states: NDArray[np.float32] | None
    turned_targets: NDArray[Any]

    def __len__(self) -> int:
        """How many."""
        return len(self.targets)

    def part(self, which: NDArray[np.bool_]) -> Examples:
        """Some of them, by a mask of shape (n,)."""
        return replace(
            self,
            pictures=None if self.pictures is None else self.pictures[which],
            states=None if self.states is None else self.states[which],
            targets=self.targets[which],
            turned_states=None if self.turned_states is None else self.turned_states[which],
            turned_targets=self.turned_targets[which],
        )


def steering_examples(
    pictures: NDArray[np.uint8], actions: NDArray[np.floating], framing: Framing
) -> Examples:
    """Pictures with steering and throttle: prepared, and refused if nothing can be learned.

    Raises:
        CloningError: If there is nothing, or it does not fit together.
    """
    if actions.ndim != 2 or actions.shape[1] != 2:
        raise CloningError(
            "Actions are steering and throttle, an array of shape (n, 2), got shape "
            f"{actions.shape}."
        )
    if len(pictures) != len(actions):
        raise CloningError(
            f"Each picture needs its action: there are {len(pictures)} pictures and "
            f"{len(actions)} actions."
        )
    if not len(actions):
        raise CloningError("There is no picture to learn from.")
    wrong = ~(np.abs(actions) <= 1.0 + _SLACK).all(axis=1)  # Also finds NaN.
    if wrong.any():
        first = int(wrong.argmax())
        raise CloningError(
            f"Steering and throttle are numbers in [-1, 1], but action {first} is "
            f"{actions[first].tolist()}."
        )
    wanted = actions.astype(np.float32)
    return Examples(prepare(pictures, framing), None, wanted, None, STEERING(wanted))


def held_out(n: int, episodes: Sequence[int], share: float) -> NDArray[np.bool_]:
    """Which of n pictures are not learned from: the last ones of each episode.

    They are the last and not any, because neighbours in time look alike: a picture between two that
    were learned from tests nothing.

    Args:
        n: How many pictures.
        episodes: Length of each episode in order; none for a single one.
        share: Of each episode, in [0, 1); rounded down.

    Raises:
        CloningError: If the lengths do not add up.
    """
    lengths = list(episodes) or [n]
    if min(lengths) < 0 or sum(lengths) != n:
        raise CloningError(
            f"The episodes have {sum(lengths)} pictures together, but there are {n} pictures."
        )
    mask = np.zeros(n, np.bool_)
    end = 0
    for length in lengths:
        end += length
        mask[end - math.floor(share * length) : end] = True
    return mask


SplitBy = Literal["time", "episode"]
"""Hold out the last stretch of time, or whole episodes."""


def judged_steps(episodes: Sequence[int], by: SplitBy, share: float) -> NDArray[np.bool_]:
    """Which steps are not learned from but judge the policy: the last ones.

    They are the last and not any, because neighbours in time look alike.

    Args:
        episodes: Steps of each episode, in order.
        by: "time" takes the last share of all steps; "episode" as many whole episodes at the end
            as it takes to have that share, at least one, and leaves at least one.
        share: In [0, 1); 0 for none.

    Returns:
        A mask of shape (sum(episodes),).

    Raises:
        CloningError: If the share is none, or there is one episode only.
    """
    if not 0.0 <= share < 1.0:
        raise CloningError(f"The held-out share is in [0, 1), got {share}.")
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
            "There is one episode only, so none can be held out: split by time in place of episode."
        )
    last = 0
    for length in reversed(lengths[1:]):
        if last and last >= share * n:
            break
        last += length
    mask[n - last :] = True
    return mask


def stretch(n: int, member: int, members: int, share: float) -> NDArray[np.bool_]:
    """Which of the learned steps choose when a member stops: a stretch of time of its own.

    Args:
        n: How many steps there are to learn from.
        member: Which one.
        members: How many there are; the stretch of the last one is the end.
        share: Length of the stretch, in [0, 1); of no more than n / (members + 1) steps.

    Returns:
        A mask of shape (n,).
    """
    length = min(math.floor(share * n), n // (members + 1))
    start = round((n - length) * (member + 1) / members)
    mask = np.zeros(n, np.bool_)
    mask[start : start + length] = True
    return mask
