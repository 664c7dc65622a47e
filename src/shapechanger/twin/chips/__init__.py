"""Chips on the board's I2C buses, register by register."""

from __future__ import annotations

from typing import Final

__all__: Final[list[str]] = []
