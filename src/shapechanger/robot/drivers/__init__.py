"""Drivers of outputs and sensors, one module per chip."""

from __future__ import annotations

from typing import Final

__all__: Final[list[str]] = []
