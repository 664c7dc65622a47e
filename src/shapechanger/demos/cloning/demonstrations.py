"""What a driver saw and did, checked and split before anything is learned from it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.cloning.errors import CloningError
from shapechanger.demos.cloning.pictures import Framing, prepare

__all__ = ["Demonstrations", "held_out"]

# Actions in single precision may miss their bound by a rounding.
_SLACK = 1e-5


@dataclass(frozen=True, slots=True)
class Demonstrations:
    """Pictures and what was done on seeing them.

    Attributes:
        pictures: As the policy sees them, shape (n, height, width, 3).
        actions: Steering (-1 is left) and throttle, each in [-1, 1], shape (n, 2).
    """

    pictures: NDArray[np.uint8]
    actions: NDArray[np.float32]

    @classmethod
    def checked(
        cls, pictures: NDArray[np.uint8], actions: NDArray[np.floating], framing: Framing
    ) -> Demonstrations:
        """Prepare the pictures, and refuse what cannot be learned from.

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
        return cls(prepare(pictures, framing), actions.astype(np.float32))


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
