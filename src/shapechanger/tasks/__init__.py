"""Rewards and endings as functions of named quantities."""

from __future__ import annotations

from typing import Final

__all__: Final[list[str]] = []
