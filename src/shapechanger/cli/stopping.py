"""Ctrl-C where there is something to say about it."""

from __future__ import annotations

__all__ = ["Interrupted"]


class Interrupted(KeyboardInterrupt):
    """The user stopped long work; the message says how to go on with it."""
