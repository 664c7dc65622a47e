"""The console: one static page with which a person sees, drives and records, and what serves it."""

from __future__ import annotations

from typing import Final

__all__: Final[list[str]] = []
