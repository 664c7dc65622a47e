"""Words for what is wrong with a profile: the file, the line, what was written and what exists."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from datetime import date
from pathlib import Path
from typing import Any, Final, cast

from shapechanger.errors import ProfileError
from shapechanger.robot.profile.lines import Place, lines_of

__all__ = ["Source", "called", "choice", "nearest", "shown"]

_LONGEST_SHOWN: Final = 40


class Source:
    """Where a profile was read, so that a mistake in it can be found.

    Attributes:
        path: The file.
    """

    def __init__(self, path: Path, text: str) -> None:
        self.path = path
        self._lines = lines_of(text)

    def line(self, place: Place) -> int:
        """The line of a table or a key; of the table that it would be in where it is missing."""
        while place and place not in self._lines:
            place = place[:-1]
        return self._lines.get(place, 1)

    def mistake(self, place: Place, words: str) -> ProfileError:
        """The error that says where the mistake is, and what."""
        return ProfileError(f"{self.path}, line {self.line(place)}: {words}.")


def called(table: Place) -> str:
    """A table, as people write it: `[output.drive]`."""
    if isinstance(table[-1], int):
        return f"[[{'.'.join(map(str, table[:-1]))}]] number {table[-1] + 1}"
    return f"[{'.'.join(map(str, table))}]"


def choice(name: str, known: Iterable[str]) -> str:
    """A name that does not exist, the nearest spelling, and what there is."""
    names = sorted(known)
    return f"{name!r}{nearest(name, names)}; there are: {', '.join(names) or 'none'}"


def nearest(name: str, known: Iterable[str]) -> str:
    """The question after a name that does not exist; empty where nothing is spelled like it."""
    close = difflib.get_close_matches(name, list(known), n=1)
    return f" (did you mean {close[0]!r}?)" if close else ""


def shown(value: Any) -> str:
    """A value, as TOML writes it; a table or a long text in short."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        short = value if len(value) <= _LONGEST_SHOWN else f"{value[:_LONGEST_SHOWN]}…"
        return f"the text {short!r}"
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list):
        items = cast("list[Any]", value)
        return "an empty list" if not items else f"a list of {len(items)}"
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, int):
        # An integer of thousands of digits cannot be written, nor need it.
        return str(value) if abs(value) < 10**_LONGEST_SHOWN else "a number too large to write"
    return f"the date {value}" if isinstance(value, date) else f"the time {value}"
