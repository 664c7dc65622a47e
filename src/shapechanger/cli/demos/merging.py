"""`shapechanger demos merge`: several recordings become one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import tyro

from shapechanger.cli.console import plain_console

__all__ = ["Merge"]

_MB: Final = 1e6


@dataclass(frozen=True)
class Merge:
    """Copy the episodes of several recordings into one; nothing is overwritten."""

    data: Annotated[
        tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="DATA [DATA ...]")
    ]
    """Folders of the recordings, or of single episodes."""
    out: Path
    """Folder of the recording that they come into."""

    def run(self) -> None:
        """Copy, and say what came of it."""
        from shapechanger.demos.merging import merge

        done = merge(self.data, self.out)
        console = plain_console()
        for source, target in done.episodes:
            if source.name != target.name:
                console.print(f"{source} became {target.name}: its name was taken", soft_wrap=True)
        many = f"{len(done.episodes)} episode{'' if len(done.episodes) == 1 else 's'}"
        console.print(f"copied {many}, {done.bytes_ / _MB:.1f} MB, to {self.out}", soft_wrap=True)
        if done.layouts > 1:
            console.print(
                f"they have {done.layouts} different layouts, and a policy learns from one: "
                "`shapechanger demos list` says what they are of",
                soft_wrap=True,
            )
