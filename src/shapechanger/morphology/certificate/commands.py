"""Commands by name: two robots with different motors get the same numbers where they can."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from shapechanger.layout import Layout

__all__ = ["Commands", "matched_commands", "number_names"]

Commands = NDArray[np.float32]
"""Commands of an episode, shape (steps, motors)."""


def matched_commands(
    source: Layout, target: Layout, steps: int, seed: int
) -> tuple[Commands, Commands]:
    """Commands for two robots: the same for motors of the same name, zero for the others.

    The numbers of a motor depend on the seed and its name alone. They lie where the ranges of the
    two overlap.

    Args:
        source: What the motors of the one take.
        target: What the motors of the other take.
        steps: How many commands to draw.
        seed: Seed of the draw.
    """
    old, new = _ranges(source), _ranges(target)
    drawn: dict[str, NDArray[np.float64]] = {}
    for name in old:
        if name in new:
            low, high = max(old[name][0], new[name][0]), min(old[name][1], new[name][1])
            share = np.random.default_rng([seed, *name.encode()]).random(steps)
            drawn[name] = low + (high - low) * share
    return _as_commands(old, drawn, steps), _as_commands(new, drawn, steps)


def _as_commands(
    ranges: dict[str, tuple[float, float]], drawn: dict[str, NDArray[np.float64]], steps: int
) -> Commands:
    """Commands in single precision, which spaces of single and of double precision both take."""
    commands = np.zeros((steps, len(ranges)), np.float32)
    for place, (name, bounds) in enumerate(ranges.items()):
        low, high = np.asarray(bounds, np.float32)
        commands[:, place] = np.clip(drawn.get(name, np.zeros(steps)), low, high)
    return commands


def _ranges(layout: Layout) -> dict[str, tuple[float, float]]:
    """For each number of an action a finite range: to -1 or 1, or beyond, where it has no bound."""
    found: dict[str, tuple[float, float]] = {}
    for name, low, high in zip(number_names(layout), layout.low, layout.high, strict=True):
        bottom = low if np.isfinite(low) else min(-1.0, high - 1.0)
        top = high if np.isfinite(high) else max(1.0, low + 1.0)
        found[name] = (float(bottom), float(top))
    return found


def number_names(layout: Layout) -> list[str]:
    """One name per number of a vector: `camera[0]`, `camera[1]` for a block."""
    names: list[str] = []
    for feature in layout:
        blocks = [f"{feature.name}[{i}]" for i in range(feature.size)]
        names += blocks if feature.shape else [feature.name]
    return names
