"""`shapechanger demos`: record, look, cut, repair, and learn from what was recorded."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import tyro

from shapechanger.cli.demos.edit import Bad, Cut, Good, MarkStep, Merge, RepairEpisodes
from shapechanger.cli.demos.exchange import Export, Import
from shapechanger.cli.demos.record import Record
from shapechanger.cli.demos.replay import Replay
from shapechanger.cli.demos.show import ListEpisodes, Show
from shapechanger.cli.demos.train import Evaluate, Train

__all__ = ["Demos"]


@dataclass(frozen=True)
class Demos:
    """Record demonstrations, look at them, and learn from them."""

    command: (
        Annotated[Record, tyro.conf.subcommand("record")]
        | Annotated[ListEpisodes, tyro.conf.subcommand("list")]
        | Annotated[Show, tyro.conf.subcommand("show")]
        | Annotated[Cut, tyro.conf.subcommand("cut")]
        | Annotated[Bad, tyro.conf.subcommand("bad")]
        | Annotated[Good, tyro.conf.subcommand("good")]
        | Annotated[MarkStep, tyro.conf.subcommand("mark")]
        | Annotated[Merge, tyro.conf.subcommand("merge")]
        | Annotated[RepairEpisodes, tyro.conf.subcommand("repair")]
        | Annotated[Replay, tyro.conf.subcommand("replay")]
        | Annotated[Import, tyro.conf.subcommand("import")]
        | Annotated[Export, tyro.conf.subcommand("export")]
        | Annotated[Train, tyro.conf.subcommand("train")]
        | Annotated[Evaluate, tyro.conf.subcommand("evaluate")]
    )

    def run(self) -> None:
        """Do what was asked."""
        self.command.run()
