"""No part of a robot looks at the clock on the wall, which may jump."""

from __future__ import annotations

import ast
from pathlib import Path
from typing import Final

import pytest

import shapechanger

PACKAGE: Final = Path(shapechanger.__file__).parent
# When a certificate is valid is a question of the calendar.
MAY: Final = {PACKAGE / "robot" / "daemon" / part for part in ("credentials.py", "pairing.py")}
WALL: Final = {
    "time.time",
    "time.time_ns",
    "time.localtime",
    "time.gmtime",
    "time.ctime",
    "time.strftime",
    "datetime.now",
    "datetime.utcnow",
    "datetime.today",
    "date.today",
}
FILES: Final = [
    path for part in ("robot", "link", "twin", "remote") for path in (PACKAGE / part).rglob("*.py")
]


def wall_clock_reads(source: str) -> list[str]:
    """Where a module asks what time it is on the wall."""
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


def test_the_search_finds_what_it_looks_for() -> None:
    """Each way to write it."""
    assert wall_clock_reads("import time\ntime.time()") == ["2: time.time"]
    assert wall_clock_reads("from time import time") == ["1: time"]
    assert wall_clock_reads("datetime.datetime.now()") == ["1: datetime.now"]
    assert wall_clock_reads("datetime.date.today()") == ["1: date.today"]
    assert wall_clock_reads("time.monotonic()") == []


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_no_wall_clock(path: Path) -> None:
    """Except where a certificate is made, and where a recording says when it was."""
    if path not in MAY:
        assert wall_clock_reads(path.read_text()) == []
