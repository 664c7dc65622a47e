"""Trials of a robot on its twin: faults are made, and the ledger says when it stopped."""

from __future__ import annotations

from typing import Final

__all__: Final[list[str]] = []
