"""The workstation's side: the client and the env of a robot."""

from __future__ import annotations

from typing import Final

__all__: Final[list[str]] = []
