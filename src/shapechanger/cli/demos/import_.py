"""`shapechanger demos import`: a recording from what others recorded."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from shapechanger.cli.console import plain_console

__all__ = ["Import", "counted"]


@dataclass(frozen=True)
class Import:
    """Make a recording of what others recorded; what is read stays as it is."""

    source: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FROM")]
    """The folder to read."""
    out: Path
    """The recording to make; nothing is there yet."""
    format: str = "auto"
    """Format of the folder: 2017, tub, minari or csv; auto looks for itself."""

    def run(self) -> None:
        """Import, and say what came."""
        from shapechanger.demos.exchange import import_recording

        done = import_recording(self.source, self.out, self.format)
        plain_console().print(
            f"read {self.source} ({done.format}): {counted(done.episodes, 'episode')}, "
            f"{counted(done.steps, 'step')}, {counted(done.pictures, 'picture')}\nwrote {self.out}",
            soft_wrap=True,
        )


def counted(number: int, what: str) -> str:
    """Such as "1 step" and "2 steps"."""
    return f"{number} {what}{'' if number == 1 else 's'}"
