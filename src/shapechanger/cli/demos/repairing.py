"""`shapechanger demos repair`: what is whole after a crash stays."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from shapechanger.cli.console import plain_console
from shapechanger.demos.episodes import episodes_of, repair
from shapechanger.errors import DemosError

if TYPE_CHECKING:
    from shapechanger.demos.episodes import Repair

__all__ = ["RepairEpisodes"]


@dataclass(frozen=True)
class RepairEpisodes:
    """Keep every complete step of a recording after a crash; what is not is moved aside."""

    data: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DATA")]
    """Folder of the recording, or of one episode."""

    def run(self) -> None:
        """Repair each episode, and say what was done."""
        console = plain_console()
        refused: list[DemosError] = []
        for path in episodes_of(self.data):
            try:
                done = repair(path)
            except DemosError as error:
                refused.append(error)
                continue
            console.print(f"{path.name}: {_told(done)}", soft_wrap=True)
        if refused:
            more = f" ({len(refused) - 1} more like it.)" if len(refused) > 1 else ""
            raise DemosError(f"{refused[0]}{more}")


def _told(done: Repair) -> str:
    """What was done, in words."""
    if not done.changed:
        return f"was whole, with {done.kept} steps"
    parts = [f"kept {done.kept} steps"]
    if done.lost:
        parts.append(f"moved {_counted(len(done.lost), 'line')} aside, because {_why(done.lost)}")
    if done.pictures:
        parts.append(f"moved {_counted(done.pictures, 'picture')} of no step aside")
    if not done.was_closed:
        parts.append("closed it")
    return ", ".join(parts)


def _why(reasons: tuple[str, ...]) -> str:
    """The first reason, and how many more there are."""
    rest = len(reasons) - 1
    return f"{reasons[0]}{f', and so on ({rest} more)' if rest else ''}"


def _counted(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"
