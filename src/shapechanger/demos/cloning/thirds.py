"""Numbers as words: left, straight or right; back, still or forward."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.layout import Layout

__all__ = ["in_thirds"]

_WORDS: Final = {
    "steering": ("left", "straight", "right"),
    "throttle": ("back", "still", "forward"),
}
_PLACES: Final = ("low", "middle", "high")


def in_thirds(actions: NDArray[np.float64], layout: Layout) -> tuple[list[str], NDArray[np.int64]]:
    """In which third of its range each number is: one class for each combination that comes up.

    Args:
        actions: Shape (n, m).
        layout: What the numbers mean; where it has no bound, the farthest action is one.

    Returns:
        The names of the classes, and the number of each action's class, shape (n,).
    """
    low = np.where(np.isfinite(layout.low), layout.low, actions.min(axis=0))
    high = np.where(np.isfinite(layout.high), layout.high, actions.max(axis=0))
    share = (actions - low) / np.where(high > low, high - low, 1.0)
    third = (share > 1.0 / 3.0).astype(np.int64) + (share > 2.0 / 3.0)
    found, numbers = np.unique(third, axis=0, return_inverse=True)
    parts = [name for feature in layout for name in [feature.name] * feature.size]
    names = [
        " ".join(_word(name, int(place)) for name, place in zip(parts, row, strict=True))
        for row in found
    ]
    return names, numbers.reshape(-1).astype(np.int64)


def _word(name: str, third: int) -> str:
    words = _WORDS.get(name.split("/")[-1])
    return words[third] if words else f"{name} {_PLACES[third]}"
