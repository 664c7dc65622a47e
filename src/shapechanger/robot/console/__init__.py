"""Web page on which a person drives and records, and the loader of its files."""

from __future__ import annotations

from typing import Final

__all__: Final[list[str]] = []
