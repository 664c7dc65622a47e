"""The server on the robot: who may command, what is sensed, and what they are told."""

from __future__ import annotations

from typing import Final

__all__: Final[list[str]] = []
