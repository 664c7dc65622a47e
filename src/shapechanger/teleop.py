"""Keyboard teleoperation: the meaning of keys, without sockets or pins."""

from __future__ import annotations

import os
import select
import sys
import termios
import tty
from dataclasses import dataclass
from typing import Final, Self

from shapechanger.errors import ShapechangerError

FIRST_HOLD_S: Final = 0.6
"""Hold time of a first press, s: terminals start repeating after up to 0.5 s. No press holds
longer."""

REPEAT_HOLD_S: Final = 0.2
"""Hold time of a repeated press, s: terminals repeat about 30 times a second. If another direction
arrives meanwhile, it holds as long as a first press."""

DIRECTIONS: Final = {
    "w": ("throttle", 1.0),
    "up": ("throttle", 1.0),
    "s": ("throttle", -1.0),
    "down": ("throttle", -1.0),
    "a": ("steering", -1.0),
    "left": ("steering", -1.0),
    "d": ("steering", 1.0),
    "right": ("steering", 1.0),
}
"""Action and direction of each key: -1 is left and backward."""


@dataclass(slots=True)
class _Held:
    value: float
    pressed_s: float
    until_s: float


class HeldKeys:
    """Values held by the keys.

    >>> keys = HeldKeys()
    >>> keys.press("w", now_s=0.0)
    True
    >>> keys.value("throttle", now_s=0.1), keys.value("throttle", now_s=0.7)
    (1.0, 0.0)
    """

    def __init__(self) -> None:
        self._held: dict[str, _Held] = {}

    def press(self, key: str, now_s: float) -> bool:
        """Register a key press.

        Args:
            key: Name of the key.
            now_s: Time of the press, s.

        Returns:
            Whether it is a direction key.
        """
        if key not in DIRECTIONS:
            return False
        action, value = DIRECTIONS[key]
        held = self._held.get(action)
        repeats = held is not None and held.value == value and now_s <= held.until_s
        until_s = now_s + (REPEAT_HOLD_S if repeats else FIRST_HOLD_S)
        # The first repeat may come long before the first hold ends: never shorten it.
        if repeats and held is not None:
            until_s = max(until_s, held.until_s)
        for other in self._held.values():
            if now_s <= other.until_s:  # Its own repeats may stop here, because this key started.
                other.until_s = max(other.until_s, other.pressed_s + FIRST_HOLD_S)
        self._held[action] = _Held(value, now_s, until_s)
        return True

    def value(self, action: str, now_s: float) -> float:
        """Return the held value of an action: -1, 0 or 1.

        Args:
            action: Name of the action, such as "steering".
            now_s: Present time, s.
        """
        held = self._held.get(action)
        return held.value if held is not None and now_s <= held.until_s else 0.0

    def let_go(self) -> None:
        """Release all keys."""
        self._held.clear()


_ARROWS: Final = {"A": "up", "B": "down", "C": "right", "D": "left"}
_ESCAPE: Final = "\x1b"


class NoTerminal(ShapechangerError, RuntimeError):
    """No terminal to read keys from."""


def keys_in(text: str) -> list[str]:
    r"""Parse terminal input into keys: letters in lower case, "up", "space", "escape".

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
    """Terminal without echo and line editing; Ctrl-C still interrupts.

    Raises:
        NoTerminal: If the standard input is not a terminal.
    """

    def __init__(self) -> None:
        if not sys.stdin.isatty():
            raise NoTerminal("Driving with keys needs a terminal, and the standard input is none.")
        self._fd = sys.stdin.fileno()
        self._before = termios.tcgetattr(self._fd)

    def __enter__(self) -> Self:
        """Disable echo and line editing."""
        tty.setcbreak(self._fd)
        return self

    def __exit__(self, *_: object) -> None:
        """Restore the terminal."""
        termios.tcsetattr(self._fd, termios.TCSADRAIN, self._before)

    def keys(self, wait_s: float) -> list[str]:
        """Return the keys pressed since the last call, waiting up to `wait_s` seconds for one.

        Raises:
            NoTerminal: If the terminal was closed.
        """
        if not select.select([self._fd], [], [], max(0.0, wait_s))[0]:
            return []
        data = os.read(self._fd, 1024)
        if not data:
            raise NoTerminal("The terminal has gone away.")
        return keys_in(data.decode(errors="replace"))
