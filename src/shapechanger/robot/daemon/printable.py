"""Words of clients, made safe for a log, a terminal and a file."""

from __future__ import annotations

__all__ = ["printable"]


def printable(text: str) -> str:
    """Without what moves a terminal's cursor, and in one line."""
    return "".join(c if c.isprintable() else " " for c in text).strip()
