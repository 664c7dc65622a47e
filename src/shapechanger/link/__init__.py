"""Protocol between a robot and its clients, without sockets, for both sides."""

from __future__ import annotations

from typing import Final

__all__: Final[list[str]] = []
