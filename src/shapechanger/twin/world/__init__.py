"""The surroundings of the twin: a room, the vehicle in it, and what its sensors see."""

from __future__ import annotations

from typing import Final

__all__: Final[list[str]] = []
