"""Single keys from a terminal, as they are pressed."""

from __future__ import annotations

import os
import select
import sys
import termios
import tty
from typing import Final, Self

from shapechanger.errors import ShapechangerError

__all__ = ["NoTerminal", "Terminal", "keys_in"]

_ARROWS: Final = {"A": "up", "B": "down", "C": "right", "D": "left"}
_ESCAPE: Final = "\x1b"


class NoTerminal(ShapechangerError, RuntimeError):
    """There is no terminal to read keys from."""


def keys_in(text: str) -> list[str]:
    r"""The keys behind what a terminal sent: letters in lower case, "up", "space", "escape".

    >>> keys_in("wW\x1b[A \x1b")
    ['w', 'w', 'up', 'space', 'escape']
    """
    keys: list[str] = []
    while text:
        if text[:2] in {"\x1b[", "\x1bO"} and text[2:3] in _ARROWS:
            keys.append(_ARROWS[text[2]])
            text = text[3:]
            continue
        names = {" ": "space", _ESCAPE: "escape", "\r": "enter", "\n": "enter"}
        keys.append(names.get(text[0], text[0].lower()))
        text = text[1:]
    return keys


class Terminal:
    """The terminal with its echo and its line editing switched off; Ctrl-C still interrupts.

    Raises:
        NoTerminal: If the standard input is none.
    """

    def __init__(self) -> None:
        if not sys.stdin.isatty():
            raise NoTerminal("Driving with keys needs a terminal, and the standard input is none.")
        self._fd = sys.stdin.fileno()
        self._before = termios.tcgetattr(self._fd)

    def __enter__(self) -> Self:
        """Switch echo and line editing off."""
        tty.setcbreak(self._fd)
        return self

    def __exit__(self, *_: object) -> None:
        """Put the terminal back as it was."""
        termios.tcsetattr(self._fd, termios.TCSADRAIN, self._before)

    def keys(self, wait_s: float) -> list[str]:
        """The keys that were pressed since the last call; waits so long for the first one.

        Raises:
            NoTerminal: If the terminal has gone away.
        """
        if not select.select([self._fd], [], [], max(0.0, wait_s))[0]:
            return []
        data = os.read(self._fd, 1024)
        if not data:
            raise NoTerminal("The terminal has gone away.")
        return keys_in(data.decode(errors="replace"))
