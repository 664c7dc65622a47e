"""Row of a table of results."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """One result next to its target.

    Attributes:
        name: Quantity that was measured.
        value: Result.
        spread: Spread of the rounds, or other context.
        target: Target, or "none".
        met: Whether the target was met.
    """

    name: str
    value: str
    spread: str
    target: str
    met: bool
