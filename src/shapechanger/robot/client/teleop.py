"""Keyboard teleoperation: the meaning of keys, without sockets or pins."""

from __future__ import annotations

import math
import os
import re
import select
import sys
import termios
import time
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
        """Register a key press at a time, s, and return whether it is a direction key."""
        if key not in DIRECTIONS:
            return False
        action, value = DIRECTIONS[key]
        held = self._held.get(action)
        until_s = now_s + FIRST_HOLD_S
        if held is not None and held.value == value and now_s <= held.until_s:
            # The first repeat may come long before the first hold ends: never shorten it.
            until_s = max(now_s + REPEAT_HOLD_S, held.until_s)
        for other in self._held.values():
            if now_s <= other.until_s:  # Its own repeats may stop here, because this key started.
                other.until_s = max(other.until_s, other.pressed_s + FIRST_HOLD_S)
        self._held[action] = _Held(value, now_s, until_s)
        return True

    def value(self, action: str, now_s: float) -> float:
        """Return the held value of an action, such as "steering", at a time, s: -1, 0 or 1."""
        held = self._held.get(action)
        return held.value if held is not None and now_s <= held.until_s else 0.0

    def let_go(self) -> None:
        """Release all keys."""
        self._held.clear()


STOPS: Final = frozenset({"space", "escape"})
"""Keys that stop the robot."""

OTHER: Final = "other"
"""Name of all other input, such as control characters, and of everything within `REST_WAIT_S` after
input that is not understood."""

ESCAPE_WAIT_S: Final = 0.05
"""Time after which an escape character is the key Escape, s. Terminals send a sequence at once, so
its second character follows within a few milliseconds, also over SSH."""

REST_WAIT_S: Final = 0.5
"""Time without input, s, after which keys count again when input was not understood."""

_ARROW: Final = re.compile(rb"\x1b[\[O]([ABCD])")
_BEGUN: Final = frozenset({b"\x1b", b"\x1b[", b"\x1bO"})  # Beginnings of an arrow.
_ARROWS: Final = {b"A": "up", b"B": "down", b"C": "right", b"D": "left"}
_NAMES: Final = {
    b" ": "space",
    b"\x00": "space",
    b"\r": "enter",
    b"\n": "enter",
}  # NUL: Ctrl+Space.


class NoTerminal(ShapechangerError, RuntimeError):
    """There is no terminal to read keys from."""


class KeyParser:
    r"""Parser of terminal input into keys.

    An escape character that does not begin an arrow is Escape, which stops: a function key, pasted
    text, a mouse report, or Escape itself in kitty's protocol. All later input up to a pause of
    `REST_WAIT_S` may belong to the same sequence, so it is `OTHER`, except for further stops.

    >>> KeyParser().feed(b"wW\x1b[A\x1b[1;5D e", now_s=0.0)
    ['w', 'w', 'up', 'escape', 'other', 'other', 'other', 'other', 'other', 'space', 'other']
    """

    def __init__(self) -> None:
        self._begun = b""  # An arrow that has begun.
        self._last_s = -math.inf  # Time of the last input.
        self._is_lost = False  # Whether input since the last pause was not understood.

    @property
    def due_s(self) -> float:
        """Time at which `expire` returns keys, s; infinity if nothing is pending."""
        return self._last_s + ESCAPE_WAIT_S if self._begun else math.inf

    def feed(self, data: bytes, now_s: float) -> list[str]:
        """Parse bytes that were read at a time, s.

        Returns:
            The keys: letters in lower case, "up", "down", "left", "right", "space", "escape",
            "enter" and `OTHER`.
        """
        keys = self.expire(now_s)
        self._is_lost &= now_s - self._last_s < REST_WAIT_S
        self._last_s = now_s
        data = self._begun + data
        while data and data not in _BEGUN:
            arrow, char = _ARROW.match(data), data[:1]
            data = data[arrow.end() if arrow else 1 :]
            if arrow:
                key = _ARROWS[arrow[1]]
            elif char == b"\x1b":
                key = "escape"
            else:
                key = _NAMES.get(char, char.decode().lower() if b"!" <= char <= b"~" else OTHER)
            keys.append(OTHER if self._is_lost and key not in STOPS else key)
            self._is_lost |= key in {"escape", OTHER}
        self._begun = data
        return keys

    def expire(self, now_s: float) -> list[str]:
        """Return Escape if the rest of an arrow has not come by a time, s, as it should have."""
        if now_s < self.due_s:
            return []
        self._begun, self._is_lost = b"", True
        return ["escape"]


def _as_typed(keys: list[str]) -> list[str]:
    """Return the keys of one read that a person can have meant.

    A stop cancels the others. Three different keys at once are pasted text, which not all
    terminals mark, or old keys from a link that was interrupted.
    """
    stops = [key for key in keys if key in STOPS]
    if stops:
        return stops[:1]
    return keys if len({*keys} - {"enter", OTHER}) <= _AT_ONCE else [OTHER]


_AT_ONCE: Final = 2
_MARK_PASTES: Final = "\x1b[?2004h"
_LEAVE_PASTES: Final = "\x1b[?2004l"


class Terminal:
    """Terminal without echo and line editing; Ctrl-C still interrupts.

    Raises:
        NoTerminal: If the standard input is not a terminal.
    """

    def __init__(self) -> None:
        if not sys.stdin.isatty():
            raise NoTerminal("Driving with keys needs a terminal, but stdin is not a terminal.")
        self._fd = sys.stdin.fileno()
        self._before = termios.tcgetattr(self._fd)
        self._parser = KeyParser()

    def __enter__(self) -> Self:
        """Disable echo, line editing and Ctrl-S, and discard the keys pressed before."""
        tty.setcbreak(self._fd)
        mode = termios.tcgetattr(self._fd)
        mode[0] &= ~termios.IXON  # Ctrl-S would hold up the output, and with it the keys.
        termios.tcsetattr(self._fd, termios.TCSAFLUSH, mode)
        self._write(_MARK_PASTES)
        return self

    def __exit__(self, *_: object) -> None:
        """Restore the terminal."""
        self._write(_LEAVE_PASTES)
        termios.tcsetattr(self._fd, termios.TCSADRAIN, self._before)

    def keys(self, wait_s: float) -> list[str]:
        """Return the keys pressed since the last call, waiting up to `wait_s` seconds for one.

        Raises:
            NoTerminal: If the terminal was closed.
        """
        until_s = time.monotonic() + wait_s
        while True:
            now_s = time.monotonic()
            keys = self._parser.expire(now_s)
            if data := self._read(0.0 if keys else min(until_s, self._parser.due_s) - now_s):
                keys += self._parser.feed(data, time.monotonic())
            if keys or time.monotonic() >= until_s:
                return _as_typed(keys)

    def _read(self, wait_s: float) -> bytes:
        """Return all available input, waiting for some up to a time limit."""
        data = b""
        while select.select([self._fd], [], [], 0.0 if data else max(0.0, wait_s))[0]:
            more = os.read(self._fd, 4096)
            if not more:
                raise NoTerminal("The terminal has gone away.")
            data += more
        return data

    def _write(self, text: str) -> None:
        if sys.stdout.isatty():
            sys.stdout.write(text)
            sys.stdout.flush()
