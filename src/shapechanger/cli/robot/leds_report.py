"""Report of a bench with LEDs, without names of the computer or its user."""

from __future__ import annotations

import contextlib
import datetime
import getpass
import platform
import re
import socket
from collections.abc import Generator
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Final

from shapechanger.cli.console import say
from shapechanger.cli.robot.leds import Bench, lamps_of
from shapechanger.errors import OutputError
from shapechanger.robot.new_file import write_new
from shapechanger.robot.profile.profile import Profile

_MARKS: Final = {"good": "good", "bad": "BAD", "unknown": "?"}


def facts(profile: Profile, *, twin: bool, root: Path = Path("/")) -> list[str]:
    """Return what the report tells about the machine and the robot.

    Args:
        profile: The robot.
        twin: Whether on its twin.
        root: Root of the file system, for tests.
    """
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
    for package in ("shapechanger", "gpiozero", "lgpio", "smbus2", "picamera2"):
        with contextlib.suppress(PackageNotFoundError):
            lines.append(f"{package:12} {version(package)}")
    lines.append(f"body         {profile.body}, {profile.control_hz:g} Hz")
    for lamp in lamps_of(profile.guard_plan()):
        lines.append(f"LED          {lamp.place}: {lamp.name}")
    return lines


def anonymous(text: str) -> str:
    """Return a text without the names of this computer, its user and the user's folders."""
    for path, name in ((Path.cwd(), "."), (Path.home(), "~")):
        if path != Path("/"):
            text = text.replace(str(path), name)
    for word, name in ((socket.gethostname(), "HOST"), (getpass.getuser(), "USER")):
        text = re.sub(rf"\b{re.escape(word)}\b", name, text)
    return text


def free_name(path: Path) -> Path:
    """Return a path, or the next one with a number that does not exist yet."""
    number = 2
    free = path
    while free.exists():
        free = path.with_stem(f"{path.stem}-{number}")
        number += 1
    return free


def run_leds(bench: Bench, profile: Profile, report: Path, *, twin: bool) -> bool:
    """Run the bench test, print it, and write its report line by line.

    Args:
        bench: The bench.
        profile: The robot.
        report: File of the report; an existing one stays, and a number is added.
        twin: Whether on its twin.

    Returns:
        Whether nothing of it was bad, apart from the settings of the computer.

    Raises:
        OutputError: If the report cannot be written.
    """
    path = free_name(report)
    counts = dict.fromkeys(("good", "bad", "unknown"), 0)
    good = True
    head = ["Shapechanger: one board with LEDs in place of motors", ""]
    with _written(path):
        write_new(path, "\n".join([*head, *facts(profile, twin=twin), ""]).encode())
        file = path.open("a", encoding="utf-8", buffering=1)
    with contextlib.closing(file):

        def tell(line: str) -> None:
            """Write a line to the report, and print it."""
            with _written(path):
                file.write(f"{anonymous(line)}\n")
            say(anonymous(line))

        try:
            for part, result in bench.results():
                if result is None:
                    tell(f"\n{part}")
                    continue
                tell(f"{_MARKS[result.level]:4}  {result.name}: {result.sentence}")
                counts[result.level] += 1
                good = good and (result.level != "bad" or part == "wiring")
        except BaseException as error:
            # Also after Ctrl-C, a report is worth sending.
            why = "it was interrupted." if isinstance(error, KeyboardInterrupt) else str(error)
            with contextlib.suppress(OSError):
                file.write(anonymous(f"\nIt ended early: {why or type(error).__name__}\n"))
            say(f"\n{path} has what was tested so far.")
            raise
        known, bad, unknown = counts.values()
        tell(f"\n{known} good, {bad} bad, {unknown} not measured.")
    say(f"wrote {path}: it holds no key, no network and no name of this computer")
    return good


@contextlib.contextmanager
def _written(path: Path) -> Generator[None]:
    """Translate failures of writing a report."""
    try:
        yield
    except OSError as error:
        raise OutputError(f"Cannot write {path}: {error.strerror or error}.") from error
