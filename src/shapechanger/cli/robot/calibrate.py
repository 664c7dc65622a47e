"""To come."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Calibrate"]


@dataclass(frozen=True)
class Calibrate:
    """To come."""

    def run(self) -> None:
        """To come."""
