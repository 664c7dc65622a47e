"""One number beside what was promised."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """One number beside what was promised.

    Attributes:
        name: What was measured.
        value: What came out.
        spread: How far the rounds lay apart, or what else the number needs to be read.
        target: What was promised.
        met: Whether it was kept.
    """

    name: str
    value: str
    spread: str
    target: str
    met: bool
