"""Setting a robot up: what the doctor looks for, and what a new robot gets."""

from __future__ import annotations

from typing import Final

__all__: Final[list[str]] = []
