"""Output of the commands: text, tables and progress bars."""

from __future__ import annotations

import shlex
import sys
import time
from typing import Final, Self

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table


def plain_console(*, stderr: bool = False, width: int | None = None) -> Console:
    """Return a console without markup or emoji, so that `a[b]` and `:a:` print verbatim."""
    return Console(stderr=stderr, width=width, markup=False, emoji=False, highlight=False)


def say(text: str, *, stderr: bool = False) -> None:
    """Print text verbatim; only the terminal wraps its lines."""
    plain_console(stderr=stderr).print(text, soft_wrap=True)


def print_table(table: Table, file_width: int | None = None) -> None:
    """Print a table, as wide as the terminal."""
    plain_console(width=None if sys.stdout.isatty() else file_width).print(table)


def counted(number: int, noun: str) -> str:
    """Format a count, such as "1 step" or "2 steps"."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def command_line() -> str:
    """Return the command that runs, as typed in a shell."""
    return shlex.join(["shapechanger", *sys.argv[1:]])


_LINE_EVERY_S: Final = 10.0
_ENOUGH_TO_TELL: Final = 0.05


class StudyProgress:
    """Progress of several runs, from the steps of each, on a console or on standard error."""

    def __init__(self, steps: dict[str, int], console: Console | None = None) -> None:
        self._steps = steps
        self._done = dict.fromkeys(steps, 0)
        self._ended: set[str] = set()
        self._console = console or plain_console(stderr=True)
        self._began = time.monotonic()
        self._last_line = self._began
        self._bar: Progress | None = None
        if self._console.is_terminal:
            self._bar = Progress(
                TextColumn("{task.description}"),
                BarColumn(),
                TextColumn("{task.percentage:>3.0f} %"),
                MofNCompleteColumn(),
                TimeElapsedColumn(),
                TextColumn("left:"),
                TimeRemainingColumn(),
                console=self._console,
            )
            self._task = self._bar.add_task("env steps", total=sum(steps.values()))

    def __enter__(self) -> Self:
        if self._bar is not None:
            self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Restore the terminal."""
        if self._bar is not None:
            self._bar.stop()

    def __call__(self, run: str, steps: int, ended: bool) -> None:
        """Report that `run` has done `steps` steps; one that has ended does no more."""
        if run in self._ended:
            return
        self._done[run] = self._steps[run] if ended else min(steps, self._steps[run])
        if ended:
            self._ended.add(run)
        if self._bar is not None:
            named = f"{len(self._ended)}/{len(self._steps)} runs"
            self._bar.update(self._task, completed=sum(self._done.values()), description=named)
            return
        now = time.monotonic()
        if ended or now - self._last_line >= _LINE_EVERY_S:
            self._last_line = now
            self._console.print(self._line(run, ended, now - self._began), soft_wrap=True)

    def _line(self, run: str, ended: bool, elapsed: float) -> str:
        """Format the progress and the estimated time left."""
        done, total = sum(self._done.values()), sum(self._steps.values())
        state = "ended" if ended else "at work"
        line = (
            f"{run} {state}; {len(self._ended)} of {len(self._steps)} runs, "
            f"{100 * done // total} % of the steps"
        )
        # The first steps include loading, so they do not predict the rest.
        if done < _ENOUGH_TO_TELL * total:
            return line
        return f"{line}, about {elapsed * (total - done) / done:.0f} s left"


class Interrupted(KeyboardInterrupt):
    """Long work was interrupted; the message tells how to resume it."""
