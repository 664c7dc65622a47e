"""A check, its findings, the run of a list of checks, and its report on screen and in a file."""

from __future__ import annotations

import contextlib
import datetime
import getpass
import platform
import re
import socket
from collections.abc import Callable, Generator, Iterable, Iterator
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Thread
from time import monotonic
from typing import Final, Literal, NamedTuple

from shapechanger.errors import OutputError, ShapechangerError
from shapechanger.robot.new_file import write_new
from shapechanger.robot.profile.profile import Profile

Level = Literal["good", "bad", "unknown"]
Results = Iterator[tuple[Level, str]]

MARKS: Final[dict[Level, str]] = {"good": "good", "bad": "BAD", "unknown": "?"}
"""Words for the levels in reports."""

CHECK_S: Final = 10.0
"""Time for each check, s; a bus whose servos are all silent needs the longest, some seconds."""


class Finding(NamedTuple):
    """Result of a check."""

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


_PACKAGES: Final = ("shapechanger", "gpiozero", "lgpio", "smbus2", "picamera2")


def facts(profile: Profile, *, twin: bool, root: Path = Path("/")) -> list[str]:
    """Return what a report tells about the machine and the robot."""
    model = root / "proc/device-tree/model"
    release = root / "etc/os-release"
    system = release.read_text(errors="replace") if release.exists() else ""
    name = re.search(r'^PRETTY_NAME="?([^"\n]*)', system, re.MULTILINE)
    board = (
        model.read_text(errors="replace").strip("\0\n ") if model.exists() else "no Raspberry Pi"
    )
    lines = [
        f"date         {datetime.datetime.now(datetime.UTC):%Y-%m-%d}",
        f"on           {'a twin' if twin else 'hardware'}",
        f"board        {board}",
        f"system       {name[1] if name else platform.system()}, Linux {platform.release()}, "
        f"{platform.machine()}",
        f"python       {platform.python_version()}",
    ]
    for package in _PACKAGES:
        with contextlib.suppress(PackageNotFoundError):
            lines.append(f"{package:12} {version(package)}")
    return [*lines, f"body         {profile.body}, {profile.control_hz:g} Hz"]


def anonymous(text: str) -> str:
    """Return a text without the names of this computer, its user and the user's folders."""
    for path, name in ((Path.cwd(), "."), (Path.home(), "~")):
        if path != Path("/"):
            text = text.replace(str(path), name)
    for word, name in ((socket.gethostname(), "HOST"), (getpass.getuser(), "USER")):
        text = re.sub(rf"\b{re.escape(word)}\b", name, text)
    return text


def _free_name(path: Path) -> Path:
    """Return a path, or the next one with a number that does not exist yet."""
    number = 2
    free = path
    while free.exists():
        free = path.with_stem(f"{path.stem}-{number}")
        number += 1
    return free


def write_report(
    parts: Iterable[tuple[str, Iterator[Finding]]],
    say: Callable[[str], object],
    path: Path | None = None,
    head: Iterable[str] = (),
) -> bool:
    """Run the parts of a check, and report each finding as it comes.

    Args:
        parts: Name and findings of each part.
        say: Tells a person a line.
        path: File that has the lines, too, without names of the computer and its user; an existing
            one stays, and a number is added. None for no file.
        head: First lines of the file.

    Returns:
        Whether nothing was bad.
    """
    counts = dict.fromkeys(MARKS, 0)
    with contextlib.ExitStack() as opened:
        file = None
        if path is not None:
            path = _free_name(path)
            with _written(path):
                write_new(path, "\n".join(["Check of a robot", "", *head, ""]).encode())
                file = opened.enter_context(path.open("a", encoding="utf-8", buffering=1))

        def tell(line: str) -> None:
            if file is not None and path is not None:
                with _written(path):
                    file.write(f"{anonymous(line)}\n")
            say(line)

        try:
            for part, findings in parts:
                tell(f"\n{part}")
                for one in findings:
                    tell(f"{MARKS[one.level]:4}  {one.check}: {one.sentence}")
                    counts[one.level] += 1
        except BaseException as error:
            # Also after Ctrl-C, a report is worth sending.
            why = "it was interrupted." if isinstance(error, KeyboardInterrupt) else str(error)
            if file is not None:
                with contextlib.suppress(OSError):
                    file.write(anonymous(f"\nIt ended early: {why or type(error).__name__}\n"))
                say(f"\n{path} has what was checked so far.")
            raise
        tell(f"\n{counts['good']} good, {counts['bad']} bad, {counts['unknown']} not measured.")
    if path is not None:
        say(f"wrote {path}: it holds no key, no network and no name of this computer")
    return not counts["bad"]


@contextlib.contextmanager
def _written(path: Path) -> Generator[None]:
    """Translate failures of writing a report."""
    try:
        yield
    except OSError as error:
        raise OutputError(f"Cannot write {path}: {error.strerror or error}.") from error
