"""What a driver saw and did, checked and split before anything is learned from it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.cloning.errors import CloningError
from shapechanger.demos.cloning.mirror import STEERING
from shapechanger.demos.cloning.pictures import Framing, prepare

__all__ = ["Examples", "held_out", "steering_examples"]

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
