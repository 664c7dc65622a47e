"""Checks, their findings, and the report of them on screen and in a file."""

from __future__ import annotations

import datetime
import getpass
import platform
import re
import socket
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from itertools import chain, count
from pathlib import Path
from threading import Thread
from typing import Final, Literal, NamedTuple

from shapechanger.errors import OutputError, ShapechangerError, translate_errors
from shapechanger.files import cannot_write
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.setup.install import Machine

Level = Literal["good", "bad", "unknown"]
Result = tuple[Level, str]  # A level and a sentence.
Results = Iterable[Result]  # A check: iterating over it performs it.
Checks = Iterable[tuple[str, Results]]  # Names and checks, which are performed one by one.
MARKS: Final[dict[Level, str]] = {"good": "good", "bad": "BAD", "unknown": "?"}


class Finding(NamedTuple):
    """Result of a check."""

    check: str
    level: Level
    sentence: str


def judged(good: bool, sentence: str, otherwise: str = "") -> Result:
    """Return a good result, or a bad one with the sentence `otherwise`, if given."""
    return ("good", sentence) if good else ("bad", otherwise or sentence)


def run_checks(checks: Checks, limit_s: float) -> Iterator[Finding]:
    """Perform checks one by one, each for at most `limit_s` seconds, and yield their findings.

    Each check runs in a separate thread, which is abandoned after this time.
    """
    for name, results in checks:
        found: list[Result] = []
        thread = Thread(target=_collect, args=(results, found), name="check", daemon=True)
        thread.start()
        thread.join(limit_s)
        if thread.is_alive():
            why = f"No answer within {limit_s:g} s: its device or driver hangs. Look at its wires "
            found = [*found, ("bad", f"{why}and supply, restart the computer, and check again.")]
        yield from (Finding(name, *result) for result in found)


def _collect(results: Results, found: list[Result]) -> None:
    try:
        for result in results:
            found.append(result)
    except ShapechangerError as error:
        found.append(("bad", str(error)))
    except Exception as error:  # Any error of a driver is a finding.
        found.append(("bad", f"The check fails: {type(error).__name__}: {error}."))


def facts(profile: Profile, *, twin: bool, root: Path = Path("/")) -> list[str]:
    """Return the lines of a report that describe the machine and the robot."""
    system = platform.system()
    with suppress(OSError):
        system = platform.freedesktop_os_release()["PRETTY_NAME"]
    lines = [
        f"date         {datetime.datetime.now(datetime.UTC):%Y-%m-%d}",
        f"on           {'a twin' if twin else 'hardware'}",
        f"board        {Machine(root=root).model or 'no Raspberry Pi'}",
        f"system       {system}, Linux {platform.release()}, {platform.machine()}",
        f"python       {platform.python_version()}",
    ]
    for package in ("shapechanger", "gpiozero", "lgpio", "smbus2", "picamera2"):
        with suppress(PackageNotFoundError):
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


def write_report(
    parts: Iterable[tuple[str, Iterator[Finding]]],
    say: Callable[[str], object],
    path: Path | None = None,
    head: Iterable[str] = (),
) -> bool:
    """Run the parts of a check, and report each finding as it comes.

    Return whether no finding was bad. `say` shows a person each line. The file at `path`, if any,
    begins with a title and the `head`; in the findings, the names of the computer and its user are
    replaced. If the file exists, a number is added to the name.
    """
    if path is not None:
        names = (path.with_stem(f"{path.stem}-{number}") for number in count(2))
        path = next(one for one in chain([path], names) if not one.exists())

    def write(text: str) -> None:
        if path is not None:
            with translate_errors(OSError, to=partial(cannot_write, path)):
                path.parent.mkdir(parents=True, exist_ok=True)
                with path.open("a", encoding="utf-8") as file:
                    print(text, file=file)

    def tell(line: str) -> None:
        write(anonymous(line))
        say(line)

    counts = dict.fromkeys(MARKS, 0)
    write("\n".join(["Check of a robot", "", *head]))
    try:
        for part, findings in parts:
            tell(f"\n{part}")
            for check, level, sentence in findings:
                tell(f"{MARKS[level]:4}  {check}: {sentence}")
                counts[level] += 1
    except BaseException as error:
        # Even after Ctrl-C, a report is worth sending.
        why = "it was interrupted." if isinstance(error, KeyboardInterrupt) else str(error)
        with suppress(OutputError):
            write(anonymous(f"\nIt ended early: {why or type(error).__name__}"))
        if path is not None:
            say(f"\n{path} has what was checked so far.")
        raise
    tell(f"\n{counts['good']} good, {counts['bad']} bad, {counts['unknown']} not measured.")
    if path is not None:
        say(f"wrote {path}: it contains no key, no network and no name of this computer")
    return not counts["bad"]
