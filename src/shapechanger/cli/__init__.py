"""The command line, `shapechanger`: its entry point and its subcommands."""

from __future__ import annotations

from shapechanger.cli.main import main

__all__ = ["main"]
