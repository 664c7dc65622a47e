"""What every chip does."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

__all__ = ["Chip"]


class Chip(Protocol):
    """A chip at one address of an I2C bus."""

    def read(self, register: int, length: int) -> list[int]:
        """Bytes, from a register on."""
        ...

    def write(self, register: int, data: Sequence[int]) -> None:
        """Write bytes, from a register on."""
        ...
