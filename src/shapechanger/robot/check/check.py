"""A check, its findings, and the run of a list of checks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from queue import Empty, SimpleQueue
from threading import Thread
from time import monotonic
from typing import Final, Literal, NamedTuple

from shapechanger.errors import ShapechangerError

Level = Literal["good", "bad", "unknown"]
Results = Iterator[tuple[Level, str]]

MARKS: Final[dict[Level, str]] = {"good": "good", "bad": "BAD", "unknown": "?"}
"""Words for the levels in reports."""

CHECK_S: Final = 10.0
"""Time for each check, s; a bus whose servos are all silent needs the longest, some seconds."""


class Finding(NamedTuple):
    """Result of a check.

    Attributes:
        check: Name of the check.
        level: "good", "bad" for something to mend, "unknown" for what cannot be checked here.
        sentence: The observation, and the way out.
    """

    check: str
    level: Level
    sentence: str


class Check(NamedTuple):
    """A check: its name, and a function that yields its results."""

    name: str
    run: Callable[[], Results]


def run_checks(checks: Iterable[Check], limit_s: float | None = None) -> Iterator[Finding]:
    """Yield the findings of a list of checks.

    Args:
        checks: The checks.
        limit_s: Time for each, s, after which the next begins, as after an error of any kind; None
            for checks that depend on those before.
    """
    for check in checks:
        results = check.run()
        if limit_s is not None:
            late = f"No answer within {limit_s:g} s: its device or driver hangs. Look at its wires "
            late += "and supply, restart the computer, and check again."
            results = finish_in_time(results, limit_s, late)
        for level, sentence in results:
            yield Finding(check.name, level, sentence)


def finish_in_time(results: Results, limit_s: float, late: str) -> Results:
    """Yield the results of a check until it ends, fails or is late.

    The check runs in a thread of its own, which is left behind if its driver hangs.

    Args:
        results: The check.
        limit_s: Time for all of it, s.
        late: Sentence if it is late.
    """
    found: SimpleQueue[tuple[Level, str] | Exception | None] = SimpleQueue()

    def run() -> None:
        try:
            for result in results:
                found.put(result)
            found.put(None)
        except Exception as error:  # Of any driver; it becomes a finding.
            found.put(error)

    Thread(target=run, name="check", daemon=True).start()
    until_s = monotonic() + limit_s
    while True:
        try:
            result = found.get(timeout=max(0.0, until_s - monotonic()))
        except Empty:
            yield "bad", late
            return
        match result:
            case None:
                return
            case ShapechangerError():
                yield "bad", str(result)
                return
            case Exception():
                yield "bad", f"The check fails: {type(result).__name__}: {result}."
                return
            case _:
                yield result


def judged(good: bool, sentence: str) -> tuple[Level, str]:
    """Return a result that is good or bad."""
    return "good" if good else "bad", sentence
