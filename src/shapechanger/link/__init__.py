"""What a robot and a workstation say to each other; pure, so both sides can share it."""

from __future__ import annotations

from typing import Final

__all__: Final[list[str]] = []
