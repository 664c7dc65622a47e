"""What a robot is made of, as one TOML file."""

from __future__ import annotations

from typing import Final

__all__: Final[list[str]] = []
