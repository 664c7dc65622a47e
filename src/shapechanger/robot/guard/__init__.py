"""Guard: the process that owns every output, and its safety rules."""

from __future__ import annotations

from typing import Final

__all__: Final[list[str]] = []
