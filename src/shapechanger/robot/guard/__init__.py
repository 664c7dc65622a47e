"""The process that owns every output, and the rules by which it moves them."""

from __future__ import annotations

from typing import Final

__all__: Final[list[str]] = []
