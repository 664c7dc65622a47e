"""The robot's side: what runs on a Raspberry Pi."""

from __future__ import annotations

from typing import Final

__all__: Final[list[str]] = []
