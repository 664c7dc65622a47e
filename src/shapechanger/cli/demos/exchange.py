"""`shapechanger demos import | export`: convert between recordings and other formats."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from shapechanger.cli.console import plain_console


@dataclass(frozen=True)
class Import:
    """Import a recording from another format, leaving the source unchanged."""

    source: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FROM")]
    """The folder to read."""
    out: Path
    """The recording to make; nothing is there yet."""
    format: str = "auto"
    """Format of the folder: 2017, tub, minari or csv; auto looks for itself."""

    def run(self) -> None:
        """Import and print a summary."""
        from shapechanger.demos.exchange import import_recording

        done = import_recording(self.source, self.out, self.format)
        plain_console().print(
            f"read {self.source} ({done.format}): {counted(done.episodes, 'episode')}, "
            f"{counted(done.steps, 'step')}, {counted(done.pictures, 'picture')}\nwrote {self.out}",
            soft_wrap=True,
        )


def counted(number: int, what: str) -> str:
    """Format a count, such as "1 step" or "2 steps"."""
    return f"{number} {what}{'' if number == 1 else 's'}"


@dataclass(frozen=True)
class Export:
    """Export a recording to another format, leaving the recording unchanged."""

    data: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DATA")]
    """A recording, or one episode of it."""
    out: Path
    """The folder to make; nothing is there yet. For minari its name ends in a version: drive-v0."""
    to: str
    """Format to write: minari, csv, 2017 or tub."""
    dropped: bool = False
    """Write the steps that were dropped, too, and that they were; only minari and csv can."""

    def run(self) -> None:
        """Export and print a summary."""
        from shapechanger.demos.exchange import export_recording

        done = export_recording(self.data, self.out, self.to, dropped=self.dropped)
        console = plain_console()
        console.print(
            f"wrote {self.out} ({done.format}): {counted(done.steps, 'step')} of "
            f"{counted(done.episodes, 'episode')}",
            soft_wrap=True,
        )
        if done.left_out:
            where = "; --dropped takes them with it" if done.format in {"minari", "csv"} else ""
            console.print(
                f"left out {done.left_out} steps that were dropped{where}", soft_wrap=True
            )
        if done.format == "minari":
            console.print(
                f"load it with MINARI_DATASETS_PATH={self.out.absolute().parent} and "
                f"minari.load_dataset({self.out.name!r})",
                soft_wrap=True,
            )
