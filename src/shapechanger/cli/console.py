"""Output of the commands: text, tables and progress bars."""

from __future__ import annotations

import shlex
import sys
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import Final, Self

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table

_WIDEST: Final = 400


def plain_console(*, stderr: bool = False, width: int | None = None) -> Console:
    """Return a console without markup or emoji, so that `a[b]` and `:a:` print verbatim."""
    return Console(stderr=stderr, width=width, markup=False, emoji=False, highlight=False)


def say(text: str, *, stderr: bool = False) -> None:
    """Print text verbatim, without wrapping its lines."""
    plain_console(stderr=stderr).print(text, soft_wrap=True)


def print_table(table: Table) -> None:
    """Print a table; outside a terminal, as wide as its content, up to `_WIDEST` columns."""
    console = plain_console()
    if not console.is_terminal:
        widest = console.options.update(width=_WIDEST)
        console = plain_console(width=console.measure(table, options=widest).maximum)
    console.print(table)


def counted(number: int, noun: str) -> str:
    """Format a count, such as "1 step" or "2 steps"."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def command_line() -> str:
    """Return the running command as it would be typed in a shell."""
    return shlex.join(["shapechanger", *sys.argv[1:]])


_LINE_EVERY_S: Final = 10.0


class StudyProgress:
    """Shows the progress of runs, by default on standard error; `steps` is the length of each."""

    def __init__(self, steps: dict[str, int], console: Console | None = None) -> None:
        self._steps = steps
        self._done = dict.fromkeys(steps, 0)
        self._ended: set[str] = set()
        self._console = console or plain_console(stderr=True)
        self._last_line = time.monotonic()
        self._bar = Progress(
            *("{task.description}", BarColumn(), "{task.percentage:>3.0f} %", MofNCompleteColumn()),
            *(TimeElapsedColumn(), "left:", TimeRemainingColumn()),
            console=self._console,
            disable=not self._console.is_terminal,
        )
        self._task = self._bar.add_task("env steps", total=sum(steps.values()))

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Restore the terminal."""
        self._bar.stop()

    def __call__(self, run: str, steps: int, ended: bool) -> None:
        """Show that `run` has done `steps` steps, or all of its steps if it has ended."""
        if run in self._ended:
            return
        self._done[run] = self._steps[run] if ended else min(steps, self._steps[run])
        if ended:
            self._ended.add(run)
        done, total = sum(self._done.values()), sum(self._steps.values())
        runs = f"{len(self._ended)}/{len(self._steps)} runs"
        self._bar.update(self._task, completed=done, description=runs)
        now = time.monotonic()
        if self._console.is_terminal or not (ended or now - self._last_line >= _LINE_EVERY_S):
            return
        self._last_line = now
        state = "ended" if ended else "at work"
        self._console.print(
            f"{run} {state}; {runs}, {100 * done // total} % of the steps", soft_wrap=True
        )


NO_POLICY: Final = "Stopped; an interrupted training leaves no policy."


class Interrupted(KeyboardInterrupt):
    """A long command was interrupted; the message explains how to resume it."""


@contextmanager
def interruptible(message: Callable[[], str]) -> Generator[None]:
    """Replace Ctrl-C in a block by an `Interrupted` with this message."""
    try:
        yield
    except KeyboardInterrupt:
        raise Interrupted(message()) from None
