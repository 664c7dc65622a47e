"""`shapechanger finger`: record how a finger moves, and find out what it is like."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import tyro

from shapechanger.cli.finger.identifying import Identify
from shapechanger.cli.finger.record import Record

__all__ = ["Finger"]


@dataclass(frozen=True)
class Finger:
    """Record how a finger moves, and find out what it is like."""

    command: (
        Annotated[Record, tyro.conf.subcommand("record")]
        | Annotated[Identify, tyro.conf.subcommand("identify")]
    )

    def run(self) -> None:
        """Do what was asked."""
        self.command.run()
