"""Places to drive in: courses laid out by a seed, how they look, and vehicles driving there."""

from __future__ import annotations

from typing import Final

__all__: Final[list[str]] = []
