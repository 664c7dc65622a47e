"""`shapechanger demos`: record, inspect, edit, share and learn from demonstrations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import tyro

from shapechanger.cli.demos.record import RecordDemonstrations
from shapechanger.cli.demos.recordings import (
    Bad,
    CutEpisode,
    Export,
    Good,
    Import,
    ListEpisodes,
    MarkStep,
    Merge,
    RepairEpisodes,
    ShowEpisodes,
)
from shapechanger.cli.demos.replay import Replay
from shapechanger.cli.demos.train import Evaluate, TrainClone
from shapechanger.cli.hub import PullDemonstrations, PushDemonstrations

__all__ = ["Demos"]


@dataclass(frozen=True)
class Demos:
    """Record, inspect, edit and share demonstrations, and learn from them."""

    command: (
        Annotated[RecordDemonstrations, tyro.conf.subcommand("record")]
        | Annotated[ListEpisodes, tyro.conf.subcommand("list")]
        | Annotated[ShowEpisodes, tyro.conf.subcommand("show")]
        | Annotated[CutEpisode, tyro.conf.subcommand("cut")]
        | Annotated[Bad, tyro.conf.subcommand("bad")]
        | Annotated[Good, tyro.conf.subcommand("good")]
        | Annotated[MarkStep, tyro.conf.subcommand("mark")]
        | Annotated[Merge, tyro.conf.subcommand("merge")]
        | Annotated[RepairEpisodes, tyro.conf.subcommand("repair")]
        | Annotated[Replay, tyro.conf.subcommand("replay")]
        | Annotated[Import, tyro.conf.subcommand("import")]
        | Annotated[Export, tyro.conf.subcommand("export")]
        | Annotated[PushDemonstrations, tyro.conf.subcommand("push")]
        | Annotated[PullDemonstrations, tyro.conf.subcommand("pull")]
        | Annotated[TrainClone, tyro.conf.subcommand("train")]
        | Annotated[Evaluate, tyro.conf.subcommand("evaluate")]
    )
