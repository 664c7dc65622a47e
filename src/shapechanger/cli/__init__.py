"""The command `shapechanger`: envs, training, playing and transfer studies."""

from __future__ import annotations

from shapechanger.cli.main import main

__all__ = ["main"]
