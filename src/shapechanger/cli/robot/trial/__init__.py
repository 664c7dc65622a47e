"""Fault trials of a robot on its twin, judged by the twin's ledger."""

from __future__ import annotations

from typing import Final

__all__: Final[list[str]] = []
