"""What a look at a robot finds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

__all__ = ["Finding"]


@dataclass(frozen=True, slots=True)
class Finding:
    """What one check came to.

    Attributes:
        check: What was looked at.
        level: "good", "missing" for something to mend, "unknown" for what cannot be told here.
        sentence: What was found, and what to do.
    """

    check: str
    level: Literal["good", "missing", "unknown"]
    sentence: str
