"""Keeps what is said short, whoever's words it repeats."""

from __future__ import annotations

__all__ = ["shortened"]


def shortened(text: str, most_bytes: int = 200) -> str:
    """The beginning of a text, as far as it fits into so many bytes of UTF-8."""
    data = text.encode(errors="replace")
    if len(data) <= most_bytes:
        return data.decode()
    return f"{data[:most_bytes].decode(errors='ignore')}..."
