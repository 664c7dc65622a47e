"""Simulated pins, buses and worlds, which stand in for the hardware below the drivers."""

from __future__ import annotations

from typing import Final

__all__: Final[list[str]] = []
