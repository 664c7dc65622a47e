"""`shapechanger demos list | show`: summaries of a recording."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import tyro
from rich.table import Table

from shapechanger.cli.console import plain_console
from shapechanger.demos.episodes import Episode, episodes_of, read_episode
from shapechanger.errors import DemosError, OutputError
from shapechanger.reports.numbers import duration_text, shares_text

_WIDEST: Final = 400


@dataclass(frozen=True)
class ListEpisodes:
    """List the episodes of a recording."""

    data: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DATA")]
    """Folder of the recording, or of one episode."""

    def run(self) -> None:
        """Print a line per episode and the totals."""
        from shapechanger.demos.statistics import summary

        table = Table(
            "episode", "of", "when (UTC)", "steps", "length", "drivers", "marks", "outcome",
            box=None, pad_edge=False,
        )  # fmt: skip
        for name in ("steps", "length", "marks"):
            next(c for c in table.columns if c.header == name).justify = "right"
        broken: list[str] = []
        steps = kept = 0
        seconds = 0.0
        paths = episodes_of(self.data)
        for path in paths:
            try:
                one = summary(read_episode(path))
            except DemosError as error:
                broken.append(str(error))
                table.add_row(path.name, "", "", "", "", "", "", "cannot be read, see below")
                continue
            steps, kept, seconds = steps + one.steps, kept + one.kept, seconds + one.seconds
            table.add_row(
                one.name,
                one.what,
                one.created[:16].replace("T", " "),
                str(one.steps) if one.kept == one.steps else f"{one.kept} of {one.steps}",
                duration_text(one.seconds),
                shares_text({str(driver): count for driver, count in one.drivers.items()}),
                str(one.marks or ""),
                one.outcome if one.closed else "not closed",
            )
        console = plain_console()
        # Truncated names could not be typed; let the terminal wrap the line.
        needed = console.measure(table, options=console.options.update(width=_WIDEST)).maximum
        plain_console(width=max(console.width, needed)).print(table)
        many = f"{len(paths)} episode{'' if len(paths) == 1 else 's'}"
        console.print(f"{many}: {kept} of {steps} steps count, {duration_text(seconds)}")
        for sentence in broken:
            console.print(sentence, soft_wrap=True)


@dataclass(frozen=True)
class ShowEpisodes:
    """Summarise a recording in numbers, or as an HTML page with frames."""

    data: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DATA")]
    """Folder of the recording, or of one episode."""
    out: Path | None = None
    """The page to write, such as page.html; it needs no other file."""

    def run(self) -> None:
        """Print the summary and write the page."""
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
    """Describe a recording in a few lines."""
    counts: Counter[str] = Counter(step.driver for one in episodes for step in one.kept)
    seconds = sum(one.seconds for one in episodes)
    many = f"{len(episodes)} episode{'' if len(episodes) == 1 else 's'}"
    steps = sum(len(one.steps) for one in episodes)
    kept = sum(len(one.kept) for one in episodes)
    lines = [f"{many}: {kept} of {steps} steps count, {duration_text(seconds)}"]
    if counts:
        lines.append(f"driven by {shares_text(dict(counts.most_common()))}")
    outcomes = Counter(one.outcome or "just ended" for one in episodes if one.closed)
    if outcomes:
        ended = ", ".join(f"{outcome} {count}" for outcome, count in outcomes.most_common())
        lines.append(f"ended by: {ended}")
    return lines
