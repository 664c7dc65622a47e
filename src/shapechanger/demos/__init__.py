"""What people and pilots have shown: demonstrations, and policies that were learned from them."""

from __future__ import annotations

__all__: list[str] = []
