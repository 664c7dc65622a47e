"""Worlds of a twin: the plain room with its vehicles, a finger, and the choice of a place.

Courses in MuJoCo come from `shapechanger.worlds`.
"""

from __future__ import annotations

from typing import Final

__all__: Final[list[str]] = []
