"""Errors in profiles, with the line and the nearest spelling.

`tomllib` does not keep line numbers. The scanner here understands just enough TOML to separate
statements, and expects text that `tomllib` has accepted.
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

Place = tuple[str | int, ...]
"""Path to a value: names of tables and keys, and numbers for entries of table arrays."""

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
    """Return the line of every table and key, from 1; of a repeated table, the first.

    Keys of inline tables are omitted: they are on the line of the table.
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
    """Return the path of a table with the newest index after each table array."""
    numbered: Place = ()
    for name in table:
        numbered += (name,)
        if numbered in counts:
            numbered += (counts[numbered] - 1,)
    return numbered


def _names(text: str, at: int) -> tuple[Place, int]:
    """Parse a dotted key and return its names and its end."""
    names: Place = ()
    while (match := _NAME.match(text, at)) is not None:
        name = match[1]
        # Escapes in quoted keys are not decoded: no key of a profile has any.
        names += (name[1:-1] if name[0] in "\"'" else name,)
        at = match.end()
        if not match[2]:
            break
    return names, at


def _end_of_statement(text: str, at: int) -> int:
    """Return the end of the last line of the statement that continues at `at`."""
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
    """Source of a profile, for error messages with line numbers.

    Attributes:
        path: The file.
    """

    def __init__(self, path: Path, text: str) -> None:
        self.path = path
        self._lines = lines_of(text)

    def line(self, place: Place) -> int:
        """Return the line of a table or key; for a missing one, that of its table."""
        while place and place not in self._lines:
            place = place[:-1]
        return self._lines.get(place, 1)

    def mistake(self, place: Place, words: str) -> ProfileError:
        """Return an error with file, line and message.

        Args:
            place: Table and key.
            words: The message.
        """
        return ProfileError(f"{self.path}, line {self.line(place)}: {words}.")


def called(table: Place) -> str:
    """Format a table name as in TOML: `[output.drive]`."""
    if isinstance(table[-1], int):
        return f"[[{'.'.join(map(str, table[:-1]))}]] number {table[-1] + 1}"
    return f"[{'.'.join(map(str, table))}]"


def choice(name: str, known: Iterable[str]) -> str:
    """Describe an unknown name: the nearest spelling and the known names.

    Args:
        name: The unknown name.
        known: The known names.
    """
    names = sorted(known)
    return f"{name!r}{nearest(name, names)}; there are: {', '.join(names) or 'none'}"


def nearest(name: str, known: Iterable[str]) -> str:
    """Return " Did you mean ...?", or an empty string if nothing is similar.

    Args:
        name: The unknown name.
        known: The known names.
    """
    close = difflib.get_close_matches(name, list(known), n=1)
    return f" (did you mean {close[0]!r}?)" if close else ""


def shown(value: Any) -> str:
    """Format a value as TOML, shortening tables and long strings."""
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
        # Python refuses to print integers with thousands of digits.
        return str(value) if abs(value) < 10**_LONGEST_SHOWN else "a number too large to write"
    return f"the date {value}" if isinstance(value, date) else f"the time {value}"
