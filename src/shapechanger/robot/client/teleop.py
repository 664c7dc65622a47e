"""Keyboard teleoperation: the meaning of keys, without sockets or pins."""

from __future__ import annotations

import codecs
import math
import os
import re
import select
import sys
import termios
import time
import tty
from collections.abc import Generator
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


STOPS: Final = frozenset({"space", "escape"})
"""Keys that stop the robot."""

OTHER: Final = "other"
"""Name of everything without its own meaning: function keys, Alt and Ctrl combinations, pasted
text, mouse reports and replies of the terminal."""

ESCAPE_WAIT_S: Final = 0.05
"""Time after which an escape character is the key Escape, s. Terminals send a sequence at once, so
its second character follows within a few milliseconds, also over SSH."""

REST_WAIT_S: Final = 0.5
"""Time that a sequence waits for its next character, s. Later characters are keys again, because
Alt+[ looks like the beginning of a sequence that never ends."""

_ARROWS: Final = {"A": "up", "B": "down", "C": "right", "D": "left"}
_ESCAPE: Final = "\x1b"
_NAMES: Final = {" ": "space", "\x00": "space", "\r": "enter", "\n": "enter"}  # NUL: Ctrl+Space.
# Control strings: DCS, SOS, OSC, PM and APC. Only an OSC may end with BEL (xterm's "ctlseqs").
_STRINGS: Final = frozenset("PX]^_")
# Characters that follow a CSI sequence without parameters: F1 to F5 of Linux' console, and mouse
# reports in the encoding of X10 and with highlights (xterm's "ctlseqs").
_TAILS: Final = {"[": 1, "M": 3, "t": 2, "T": 6}
# Escape and Space where a program has left kitty's protocol or xterm's modifyOtherKeys enabled;
# ":3" is a release.
_STOP_CODES: Final = re.compile(r"(27|32)(?:;(?!\d*:3)[\d:;]*)?u|27;\d+;(27|32)~")


class NoTerminal(ShapechangerError, RuntimeError):
    """No terminal to read keys from."""


def _skip(count: int) -> Generator[None, str, str]:
    """Take characters that mean nothing."""
    for _ in range(count):
        yield
    return OTHER


class KeyParser:
    r"""Parser of terminal input into keys.

    Sequences are parsed whole (ECMA-48 and xterm's "ctlseqs"), however the reads split them, and
    an unknown one is `OTHER` and never letters. Only Space and Escape count within a sequence or
    within pasted text, because a stop must never be lost.

    >>> KeyParser().feed(b"wW\x1b[A\x1b[1;5D \x1be", now_s=0.0)
    ['w', 'w', 'up', 'other', 'space', 'other']
    """

    def __init__(self) -> None:
        # A byte that is not UTF-8 becomes a lone surrogate.
        self._decoder = codecs.getincrementaldecoder("utf-8")("surrogateescape")
        self._rest: Generator[None, str, str] | None = None  # Takes a sequence, returns its key.
        self._is_alone = False  # Only the escape character of the sequence has come.
        self._is_string = False
        self._begun_s = 0.0
        self._last_s = 0.0
        self._is_reported = False  # The sequence was reported as Escape: its rest is nothing.
        self._is_pasted = False

    @property
    def due_s(self) -> float:
        """Time at which `expire` returns keys, s; infinity if nothing is pending."""
        if self._rest is None:
            return math.inf
        if self._is_alone and not self._is_reported:
            return self._begun_s + ESCAPE_WAIT_S
        return self._last_s + REST_WAIT_S

    def feed(self, data: bytes, now_s: float) -> list[str]:
        """Parse input.

        Args:
            data: The bytes.
            now_s: Time at which they were read, s.

        Returns:
            The keys: letters in lower case, "up", "down", "left", "right", "space", "escape",
            "enter" and `OTHER`.
        """
        keys = self.expire(now_s)
        for char in self._decoder.decode(data):
            key = self._key(char, now_s)
            if key is not None:
                keys.append(OTHER if self._is_pasted and key not in STOPS else key)
        self._last_s = now_s
        return keys

    def expire(self, now_s: float) -> list[str]:
        """Return the keys of sequences whose rest did not come in time.

        Args:
            now_s: Present time, s.
        """
        keys: list[str] = []
        if self._is_alone and not self._is_reported and now_s >= self.due_s:
            keys.append("escape")
            self._is_reported = True
            self._is_pasted = False  # The end of the pasted text was lost.
        if self._rest is not None and now_s >= self.due_s:
            if not self._is_reported:
                keys.append(OTHER)
            self._begin(None, now_s)
        return keys

    def _key(self, char: str, now_s: float) -> str | None:
        """Advance by one character, and return the key that it completes."""
        code = ord(char) - 0xDC00 if "\udc80" <= char <= "\udcff" else ord(char)
        is_byte = code != ord(char)
        if char in {" ", "\x00"}:
            if self._is_alone:
                self._step(" ")
            return "space"
        if char == _ESCAPE:
            was_alone = self._is_alone and not self._is_reported
            self._begin(self._sequence(), now_s, is_alone=True)
            self._is_reported = was_alone
            return "escape" if was_alone else None
        if 0x80 <= code < 0xA0:  # C1 controls: ESC and a character of seven bits.
            if self._is_string and code != 0x9C:
                return None
            introducer = chr(code - 0x40)
            if not is_byte or introducer in {"[", "O", "\\", *_STRINGS}:
                self._begin(self._sequence(), now_s)
                return self._step(introducer)
            self._begin(None, now_s)
        if is_byte and self._rest is None:
            # A character of another encoding, whose second byte may be a letter's.
            return self._begin(_skip(1), now_s)
        return self._step(char)

    def _begin(
        self, rest: Generator[None, str, str] | None, now_s: float, *, is_alone: bool = False
    ) -> None:
        """Begin a sequence, or end one."""
        self._rest, self._begun_s = rest, now_s
        self._is_alone, self._is_string, self._is_reported = is_alone, False, False
        if rest is not None:
            next(rest)

    def _step(self, char: str) -> str | None:
        """Advance by one character that begins no sequence."""
        if self._rest is None:
            return _NAMES.get(char, char.lower() if "!" <= char <= "~" else OTHER)
        self._is_alone = False
        try:
            self._rest.send(char)
        except StopIteration as end:
            key = None if self._is_reported else end.value
            self._begin(None, 0.0)
            return key
        return None

    def _sequence(self) -> Generator[None, str, str]:
        """Take the characters after an escape character, and return their key."""
        kind = yield
        if kind in _STRINGS:
            self._is_string = True
            while (yield) != "\x07" or kind != "]":
                pass
            return OTHER
        if kind not in "[O" and not " " <= kind <= "/":
            return OTHER  # Alt and a key, or the end of a string.
        text = ""
        while not "@" <= text[-1:] <= "~":
            text += yield
            if kind == "[" and text in _TAILS:
                return (yield from _skip(_TAILS[text]))
        if text in {"200~", "201~"} and kind == "[":
            self._is_pasted = text == "200~"
        if stop := _STOP_CODES.fullmatch(text):
            return "escape" if "27" in stop.groups() else "space"
        return _ARROWS.get(text, OTHER)


def _as_typed(keys: list[str]) -> list[str]:
    """Return the keys of one read that a person can have meant.

    A stop cancels the others. Three different keys at once are pasted text or old keys of a link
    that stood still: many terminals mark pasted text, and some do not.
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
        """Return all input that is there, waiting for it up to a time."""
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
