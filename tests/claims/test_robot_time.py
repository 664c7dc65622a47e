"""Robot code reads the wall clock, which can jump, for calendar dates only."""

import ast
from pathlib import Path
from typing import Final

import shapechanger

PACKAGE: Final = Path(shapechanger.__file__).parent
# The validity of a certificate and the day of a recording or a report are calendar dates.
MAY: Final = {
    PACKAGE / "robot" / part
    for part in ("check/report.py", "daemon/credentials.py", "daemon/recorder.py")
}
WALL: Final = {
    *(f"time.{name}" for name in ("time", "time_ns", "localtime", "gmtime", "ctime", "strftime")),
    *("datetime.now", "datetime.utcnow", "datetime.today", "date.today"),
}
FILES: Final = [
    path
    for place in ("robot/**/*.py", "*/remote.py", "*/remote/*.py", "*/twin.py")
    for path in PACKAGE.glob(place)
]


def wall_clock_reads(source: str) -> list[str]:
    """Return the line and name of each read of the wall clock in a module."""
    found: list[str] = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Attribute):
            name = ".".join(ast.unparse(node).split(".")[-2:])
            if name in WALL or name == "time.CLOCK_REALTIME":
                found.append(f"{node.lineno}: {name}")
        elif isinstance(node, ast.ImportFrom) and node.module == "time":
            names = [alias.name for alias in node.names if f"time.{alias.name}" in WALL]
            found += [f"{node.lineno}: {name}" for name in names]
    return found


def test_the_search_finds_each_spelling() -> None:
    assert wall_clock_reads("import time\ntime.time()") == ["2: time.time"]
    assert wall_clock_reads("from time import time") == ["1: time"]
    assert wall_clock_reads("datetime.datetime.now()") == ["1: datetime.now"]
    assert wall_clock_reads("datetime.date.today()") == ["1: date.today"]
    assert wall_clock_reads("time.monotonic()") == []


def test_no_wall_clock() -> None:
    """Only certificates and the dates of recordings and reports read the calendar."""
    reads = {
        str(path.relative_to(PACKAGE)): found
        for path in FILES
        if path not in MAY and (found := wall_clock_reads(path.read_text()))
    }
    assert reads == {}
