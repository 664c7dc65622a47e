"""What is to come out of a policy: one of the actions that were shown, or any numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.cloning.card import Head
from shapechanger.demos.cloning.errors import CloningError
from shapechanger.layout import Layout

__all__ = ["MOST_CLASSES", "AskedHead", "Goal", "class_numbers", "goal_of", "named"]

AskedHead = Literal["auto", "class", "regression"]
"""How it is asked for: "auto" chooses classes where few different actions were shown."""

MOST_CLASSES: Final = 16
"""More different actions than this are numbers and not keys."""

# Each different action comes at least so often on average, or it was no choice among a few.
_LEAST_EACH: Final = 4
# Actions in single precision may differ by a rounding.
_SAME: Final = 1e-4


@dataclass(frozen=True, slots=True)
class Goal:
    """What is to come out.

    Attributes:
        head: Numbers or classes.
        classes: The different actions, most frequent first; () for numbers.
        names: What they are called.
        low: Smallest value of each number; () for classes.
        high: Largest value of each number.
    """

    head: Head
    classes: tuple[tuple[float, ...], ...] = ()
    names: tuple[str, ...] = ()
    low: tuple[float, ...] = ()
    high: tuple[float, ...] = ()

    def targets(self, actions: NDArray[np.float32]) -> NDArray[Any]:
        """What the network is to give for actions of shape (n, m).

        Returns:
            Numbers of classes, shape (n,), -1 for an action that is none of them; or actions scaled
            to [-1, 1], shape (n, m).
        """
        if self.head == "class":
            return class_numbers(actions, self.classes)
        low, high = np.asarray(self.low, np.float32), np.asarray(self.high, np.float32)
        return (2.0 * (actions - low) / (high - low) - 1.0).astype(np.float32).clip(-1.0, 1.0)


def goal_of(
    actions: NDArray[np.float32],
    layout: Layout,
    asked: AskedHead,
    mirrored: NDArray[np.float32] | None = None,
) -> Goal:
    """What is to come out, by what was shown.

    Args:
        actions: What the driver did, shape (n, m).
        layout: What the numbers mean.
        asked: Which head.
        mirrored: The same in the mirror, if pictures are mirrored; None if not.

    Raises:
        CloningError: If there are too many different actions for classes, or all are the same.
    """
    both = actions if mirrored is None else np.concatenate((actions, mirrored))
    different, counts = np.unique(both, axis=0, return_counts=True)
    few = len(different) <= MOST_CLASSES and _LEAST_EACH * len(different) <= len(actions)
    if asked == "class" and len(different) > MOST_CLASSES:
        raise CloningError(
            f"There are {len(different)} different actions, and classes are at most "
            f"{MOST_CLASSES}: choose the head regression."
        )
    if len(np.unique(actions, axis=0)) < 2 and asked != "regression":
        raise CloningError(
            f"The driver did the same in all of {len(actions)} steps "
            f"({named(actions[0], layout)}), so there is nothing to learn."
        )
    if asked == "class" or (asked == "auto" and few):
        order = np.argsort(-counts, kind="stable")
        classes = tuple(tuple(map(float, different[i])) for i in order)
        return Goal("class", classes, tuple(named(np.asarray(c), layout) for c in classes))
    low = np.where(np.isfinite(layout.low), layout.low, both.min(axis=0))
    high = np.where(np.isfinite(layout.high), layout.high, both.max(axis=0))
    high = np.where(high > low, high, low + 1.0)  # A number that never changes.
    return Goal("regression", low=tuple(map(float, low)), high=tuple(map(float, high)))


def class_numbers(
    actions: NDArray[np.floating], classes: tuple[tuple[float, ...], ...]
) -> NDArray[np.int64]:
    """Which class each action is, shape (n,); -1 for none of them."""
    known = np.asarray(classes, np.float32)
    apart = np.abs(actions[:, None, :] - known).max(axis=2)
    return np.where(apart.min(axis=1) < _SAME, apart.argmin(axis=1), -1).astype(np.int64)


def named(action: NDArray[np.floating], layout: Layout) -> str:
    """What an action is called: the keys that it holds down, or its numbers."""
    parts = [name.split("/")[-1] for name in layout.names]
    if len(parts) != len(action):
        return " ".join(f"{value:g}" for value in action)
    is_keys = "forward" in parts and "left" in parts and set(action.tolist()) <= {0.0, 1.0}
    if is_keys:
        held = [part for part, value in zip(parts, action, strict=True) if value]
        return "+".join(held) or "none"
    return ", ".join(f"{part} {value:g}" for part, value in zip(parts, action, strict=True))
