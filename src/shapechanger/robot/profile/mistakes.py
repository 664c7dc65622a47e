"""On which line of a TOML text each table and key stands.

`tomllib` reads the text but forgets where it was. This scanner knows just enough of TOML to tell
statements apart, and is for texts that `tomllib` has accepted.
"""

from __future__ import annotations

import bisect
import difflib
import re
from collections.abc import Iterable
from datetime import date
from pathlib import Path
from typing import Any, Final, cast

from shapechanger.errors import ProfileError

__all__ = ["Place", "Source", "called", "choice", "lines_of", "nearest", "shown"]

Place = tuple[str | int, ...]
"""Names of the tables and the key that lead to a value; a number for a table of a list."""

_NAME: Final = re.compile(r"""[ \t]*("(?:[^"\\]|\\.)*"|'[^']*'|[A-Za-z0-9_-]+)[ \t]*(\.?)""")
_PIECE: Final = re.compile(
    r'''
      """(?:[^\\]|\\.)*?"{3,5}    # A text over several lines.
    | \'\'\'.*?\'{3,5}
    | "(?:[^"\\\n]|\\.)*"         # A text.
    | '[^'\n]*'
    | \#[^\n]*                    # A comment.
    | .                           # Anything else, character by character.
    ''',
    re.VERBOSE | re.DOTALL,
)


def lines_of(text: str) -> dict[Place, int]:
    """The line, from 1, of every table and key; of a table that is named twice, the first.

    Keys of an inline table are left out: they stand on the line of the table.
    """
    newlines = [i for i, character in enumerate(text) if character == "\n"]
    lines: dict[Place, int] = {}
    counts: dict[Place, int] = {}
    table: Place = ()
    at = 0
    while at < len(text):
        if text[at].isspace():
            at += 1
            continue
        line = bisect.bisect_left(newlines, at) + 1
        if text[at] == "[":
            brackets = 2 if text.startswith("[[", at) else 1
            names, at = _names(text, at + brackets)
            if brackets == 2:
                this = _numbered(names[:-1], counts) + names[-1:]
                counts[this] = counts.get(this, 0) + 1
            table = _numbered(names, counts)
            _note(lines, table, line)
        elif text[at] != "#":
            key, at = _names(text, at)
            _note(lines, table + key, line)
        at = _end_of_statement(text, at)
    return lines


def _note(lines: dict[Place, int], place: Place, line: int) -> None:
    for end in range(1, len(place) + 1):
        lines.setdefault(place[:end], line)


def _numbered(table: Place, counts: dict[Place, int]) -> Place:
    """The table with the number of its newest entry after each name of a list."""
    numbered: Place = ()
    for name in table:
        numbered += (name,)
        if numbered in counts:
            numbered += (counts[numbered] - 1,)
    return numbered


def _names(text: str, at: int) -> tuple[Place, int]:
    """The names of a dotted key, and where it ends."""
    names: Place = ()
    while (match := _NAME.match(text, at)) is not None:
        name = match[1]
        # Escapes in a quoted key are left as they are: such a key is no key of a profile.
        names += (name[1:-1] if name[0] in "\"'" else name,)
        at = match.end()
        if not match[2]:
            break
    return names, at


def _end_of_statement(text: str, at: int) -> int:
    """Where the line ends on which the statement does that goes on at `at`."""
    depth = 0
    while (match := _PIECE.match(text, at)) is not None:
        piece = match[0]
        if piece == "\n" and depth <= 0:
            break
        depth += (piece in "[{") - (piece in "]}")
        at = match.end()
    return at


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
