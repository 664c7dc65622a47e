"""Keyboard teleoperation: reading keys from a terminal, and their meaning."""

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
from dataclasses import dataclass
from typing import Final, Self

from shapechanger.errors import ShapechangerError

FIRST_HOLD_S: Final = 0.6
"""Hold time of a first press, s: terminals start repeating after up to 0.5 s. No press is held
longer."""

REPEAT_HOLD_S: Final = 0.2
"""Hold time of a repeated press, s: terminals repeat about 30 times a second. If another direction
key is pressed, the earlier key is held as long as after a first press."""

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
        until_s = now_s + FIRST_HOLD_S
        if held is not None and held.value == value and now_s <= held.until_s:
            # The first repeat may come long before the first hold ends: never shorten it.
            until_s = max(now_s + REPEAT_HOLD_S, held.until_s)
        for other in self._held.values():
            if now_s <= other.until_s:  # Terminals repeat only the newest key.
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
"""Name of all other input: function keys, Alt and Ctrl combinations, pasted text, mouse reports and
replies of the terminal."""

ESCAPE_WAIT_S: Final = 0.05
"""Time after which an escape character is the key Escape, s. Terminals send a sequence at once, so
its second character follows within a few milliseconds, also over SSH."""

REST_WAIT_S: Final = 0.5
"""Time that a sequence waits for its next character, s. Later characters are keys again, because
Alt+[ looks like the beginning of a sequence that never ends."""

_ESCAPE: Final = "\x1b"
_ARROWS: Final = {
    f"{_ESCAPE}{kind}{letter}": key
    for kind in "[O"
    for letter, key in {"A": "up", "B": "down", "C": "right", "D": "left"}.items()
}
_NAMES: Final = {" ": "space", "\x00": "space", "\r": "enter", "\n": "enter"}  # NUL: Ctrl+Space.
# Control strings: DCS, SOS, OSC, PM and APC. Only an OSC may end with BEL (xterm's "ctlseqs").
_STRINGS: Final = frozenset("PX]^_")
# Characters that follow a CSI sequence without parameters: F1 to F5 of Linux' console, and mouse
# reports in the encoding of X10 and with highlights (xterm's "ctlseqs").
_TAILS: Final = {"[": 1, "M": 3, "t": 2, "T": 6}
# Escape and Space where a program has left kitty's protocol or xterm's modifyOtherKeys enabled;
# ":3" is a release.
_STOP_CODES: Final = re.compile(
    rf"{_ESCAPE}[\[O](?:(27|32)(?:;(?!\d*:3)[\d:;]*)?u|27;\d+;(27|32)~)"
)
_PASTES: Final = {f"{_ESCAPE}[200~": True, f"{_ESCAPE}[201~": False}  # Begin and end.
_LONGEST: Final = 64  # The middle of a longer sequence is dropped.


class NoTerminal(ShapechangerError, RuntimeError):
    """There is no terminal to read keys from."""


def _is_whole(text: str) -> bool:
    """Return whether a sequence is complete; it includes its escape character."""
    kind, rest = text[1:2], text[2:]
    if not text.startswith(_ESCAPE):  # A character of another encoding.
        return bool(kind)
    if kind in _STRINGS:
        return kind == "]" and rest.endswith("\x07")
    if kind not in "[O" and not " " <= kind <= "/":
        return True  # Alt and a key, or the end of a string.
    if kind == "[" and rest[:1] in _TAILS:
        return len(rest) > _TAILS[rest[0]]
    return "@" <= rest[-1:] <= "~"


class KeyParser:
    r"""Parser of terminal input into keys.

    Sequences (ECMA-48 and xterm's "ctlseqs") are recognised even if they are split over several
    reads, and unknown ones become `OTHER`, never letters. Only Space and Escape count within a
    sequence or within pasted text, because a stop must never be lost.

    >>> KeyParser().feed(b"wW\x1b[A\x1b[1;5D \x1be", now_s=0.0)
    ['w', 'w', 'up', 'other', 'space', 'other']
    """

    def __init__(self) -> None:
        # A byte that is not UTF-8 becomes a lone surrogate.
        self._decoder = codecs.getincrementaldecoder("utf-8")("surrogateescape")
        self._text = ""  # Sequence that has begun.
        self._is_reported = False  # Whether it was reported as Escape; the rest is then ignored.
        self._is_pasted = False
        self._last_s = 0.0

    @property
    def due_s(self) -> float:
        """Time at which `expire` returns keys, s; infinity if no key is pending."""
        if not self._text:
            return math.inf
        is_alone = self._text == _ESCAPE and not self._is_reported
        return self._last_s + (ESCAPE_WAIT_S if is_alone else REST_WAIT_S)

    def feed(self, data: bytes, now_s: float) -> list[str]:
        """Parse input.

        Args:
            data: The bytes.
            now_s: Time at which they were read, s.

        Returns:
            The keys: printable ASCII characters (letters in lower case), "up", "down", "left",
            "right", "space", "escape", "enter" and `OTHER`.
        """
        keys = self.expire(now_s)
        text = self._decoder.decode(data)
        for char in text:
            key = self._key(char)
            if key is not None:
                keys.append(OTHER if self._is_pasted and key not in STOPS else key)
        # An incomplete UTF-8 character does not delay Escape.
        if text or self._is_reported or self._text != _ESCAPE:
            self._last_s = now_s
        return keys

    def expire(self, now_s: float) -> list[str]:
        """Return the keys of sequences whose rest did not come in time.

        Args:
            now_s: Present time, s.
        """
        keys: list[str] = []
        if self._text == _ESCAPE and not self._is_reported and now_s >= self.due_s:
            keys.append("escape")
            self._is_reported = True
            self._is_pasted = False  # The end of the pasted text was lost.
        if now_s >= self.due_s:
            keys += [] if self._is_reported else [OTHER]
            self._text = ""
        return keys

    def _key(self, char: str) -> str | None:
        """Advance by one character, and return the key that it completes."""
        code = ord(char) - 0xDC00 if "\udc80" <= char <= "\udcff" else ord(char)
        is_byte = code != ord(char)
        if char in {" ", "\x00"}:
            self._text += " " if self._text == _ESCAPE else ""
            return "space"
        if char == _ESCAPE:
            self._is_reported = self._text == _ESCAPE and not self._is_reported
            self._text = _ESCAPE
            return "escape" if self._is_reported else None
        if 0x80 <= code < 0xA0:  # C1 controls: ESC and a character of seven bits.
            if self._text[1:2] in _STRINGS and code != 0x9C:
                return None
            self._text, introducer = "", chr(code - 0x40)
            if not is_byte or introducer in {"[", "O", "\\", *_STRINGS}:
                self._text, self._is_reported, char = _ESCAPE, False, introducer
        if not self._text:
            if not is_byte:
                return _NAMES.get(char, char.lower() if "!" <= char <= "~" else OTHER)
            # A character of another encoding, whose second byte may be a letter's.
            self._text, self._is_reported = char, False
            return None
        text = self._text = self._text[:_LONGEST] + char
        if not _is_whole(text):
            return None
        self._text = ""
        self._is_pasted = _PASTES.get(text, self._is_pasted)
        if self._is_reported:
            return None
        if stop := _STOP_CODES.fullmatch(text):
            return "escape" if "27" in stop.groups() else "space"
        return _ARROWS.get(text, OTHER)


_AT_ONCE: Final = 2  # Different keys that a person presses at once.


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
        mode[0] &= ~termios.IXON  # Ctrl-S would block the output, and so the reading of keys.
        termios.tcsetattr(self._fd, termios.TCSAFLUSH, mode)
        self._write("\x1b[?2004h")  # Mark pasted text.
        return self

    def __exit__(self, *_: object) -> None:
        """Restore the terminal."""
        self._write("\x1b[?2004l")
        termios.tcsetattr(self._fd, termios.TCSADRAIN, self._before)

    def keys(self, wait_s: float) -> list[str]:
        """Return the keys pressed since the last call, waiting up to `wait_s` seconds for one.

        Only keys that a person can have meant are returned.

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
                # A stop cancels all other keys.
                if stops := [key for key in keys if key in STOPS]:
                    return stops[:1]
                # More different keys at once are pasted text, which not all terminals mark, or old
                # keys from a link that was interrupted.
                return keys if len({*keys} - {"enter", OTHER}) <= _AT_ONCE else [OTHER]

    def _read(self, wait_s: float) -> bytes:
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
