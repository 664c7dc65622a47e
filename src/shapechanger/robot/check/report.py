"""The report of checks: a line for each finding, told at once, and a file to send."""

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
from typing import Final

from shapechanger.errors import OutputError
from shapechanger.robot.check.check import MARKS, Finding
from shapechanger.robot.new_file import write_new
from shapechanger.robot.profile.profile import Profile

_PACKAGES: Final = ("shapechanger", "gpiozero", "lgpio", "smbus2", "picamera2")


def facts(profile: Profile, *, twin: bool, root: Path = Path("/")) -> list[str]:
    """Return what a report tells about the machine and the robot.

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

    Raises:
        OutputError: If the file cannot be written.
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
