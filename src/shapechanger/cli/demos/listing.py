"""`shapechanger demos list`: the episodes of a recording."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import tyro
from rich.table import Table

from shapechanger.cli.console import plain_console
from shapechanger.demos.episodes import episodes_of, read_episode
from shapechanger.errors import DemosError

__all__ = ["ListEpisodes", "shares", "told_length"]

_WIDEST: Final = 400


@dataclass(frozen=True)
class ListEpisodes:
    """List the episodes of a recording."""

    data: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DATA")]
    """Folder of the recording, or of one episode."""

    def run(self) -> None:
        """Print a line for each, and what they are together."""
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
                told_length(one.seconds),
                shares({str(driver): count for driver, count in one.drivers.items()}),
                str(one.marks or ""),
                one.outcome if one.closed else "not closed",
            )
        console = plain_console()
        # A name that is cut off cannot be typed: rather let the terminal break the line.
        needed = console.measure(table, options=console.options.update(width=_WIDEST)).maximum
        plain_console(width=max(console.width, needed)).print(table)
        many = f"{len(paths)} episode{'' if len(paths) == 1 else 's'}"
        console.print(f"{many}: {kept} of {steps} steps count, {told_length(seconds)}")
        for sentence in broken:
            console.print(sentence, soft_wrap=True)


def told_length(seconds: float) -> str:
    """A time as people say it.

    >>> told_length(4.25), told_length(59.97), told_length(754.0)
    ('4.2 s', '1:00 min', '12:34 min')
    """
    if round(seconds, 1) < 60.0:  # A minute.
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes}:{rest:02d} min"


def shares(counts: dict[str, int]) -> str:
    """Who did how much.

    >>> shares({"policy": 30, "expert": 10}), shares({"expert": 4})
    ('policy 75 %, expert 25 %', 'expert')
    """
    total = sum(counts.values())
    if len(counts) == 1:
        return next(iter(counts))
    return ", ".join(f"{name} {100.0 * count / total:.0f} %" for name, count in counts.items())
