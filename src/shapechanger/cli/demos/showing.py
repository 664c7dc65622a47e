"""`shapechanger demos show`: a recording in numbers, and as a page with pictures."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from shapechanger.cli.console import plain_console
from shapechanger.cli.demos.listing import shares, told_length
from shapechanger.demos.episodes import Episode, episodes_of, read_episode
from shapechanger.errors import DemosError, OutputError

__all__ = ["Show"]


@dataclass(frozen=True)
class Show:
    """Say what is in a recording in numbers, or show it as a page with pictures."""

    data: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DATA")]
    """Folder of the recording, or of one episode."""
    out: Path | None = None
    """The page to write, such as page.html; it needs no other file."""

    def run(self) -> None:
        """Print the numbers, and write the page."""
        from shapechanger.reports.demonstrations import distributions

        if self.out is not None and self.out.is_dir():
            raise OutputError(f"Cannot write {self.out}: it is a folder.")
        episodes: list[Episode] = []
        broken: list[str] = []
        for path in episodes_of(self.data):
            try:
                episodes.append(read_episode(path))
            except DemosError as error:
                broken.append(str(error))
        console = plain_console()
        for line in _told(episodes):
            console.print(line, soft_wrap=True)
        for name, unit, found in distributions(episodes):
            of = "" if unit == "1" else f" {unit}"
            console.print(
                f"{name}: {found.least:.3g} to {found.most:.3g}{of}, median {found.median:.3g}",
                soft_wrap=True,
            )
        for sentence in broken:
            console.print(sentence, soft_wrap=True)
        if self.out is None:
            return
        from shapechanger.reports.demonstrations import recording_html
        from shapechanger.transfer.files import make_folder, write_atomic

        make_folder(self.out.parent)
        name = self.data.resolve().name
        write_atomic(self.out, recording_html(name, episodes, broken).encode())
        console.print(f"wrote {self.out}", soft_wrap=True)


def _told(episodes: Sequence[Episode]) -> list[str]:
    """What a recording is, in a few lines."""
    counts: Counter[str] = Counter(step.driver for one in episodes for step in one.kept)
    seconds = sum(one.seconds for one in episodes)
    many = f"{len(episodes)} episode{'' if len(episodes) == 1 else 's'}"
    steps = sum(len(one.steps) for one in episodes)
    kept = sum(len(one.kept) for one in episodes)
    lines = [f"{many}: {kept} of {steps} steps count, {told_length(seconds)}"]
    if counts:
        lines.append(f"driven by {shares(dict(counts.most_common()))}")
    outcomes = Counter(one.outcome or "just ended" for one in episodes if one.closed)
    if outcomes:
        ended = ", ".join(f"{outcome} {count}" for outcome, count in outcomes.most_common())
        lines.append(f"ended by: {ended}")
    return lines
