"""Where pictures come from."""

from __future__ import annotations

from typing import Final

__all__: Final[list[str]] = []
