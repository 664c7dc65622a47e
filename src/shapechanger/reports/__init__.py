"""Pages that need no other file: their markup, their pictures and how they look."""

from __future__ import annotations

__all__: list[str] = []
