"""What a key of a profile may hold."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from datetime import date, datetime
from typing import Any, Final, Literal, cast

from shapechanger.robot.profile.mistake import nearest, shown
from shapechanger.robot.profile.pins import HIGHEST_BCM, bcm
from shapechanger.robot.profile.units import unit_of

__all__ = ["NO_PIN", "REQUIRED", "Key", "Kind"]

Kind = Literal[
    "number", "whole", "text", "truth", "pin", "pins", "size", "weights", "date", "choice"
]
"""What sort of value a key holds."""

REQUIRED: Final = object()
"""The default of a key that has none."""

NO_PIN: Final = -1
"""The value of a pin that is not connected."""

_LONGEST_TEXT: Final = 64  # As names on the wire, see `shapechanger.link.messages`.
_NOT_PRINTABLE: Final = re.compile(r"[^\x20-\x7e\xa0-\U0010ffff]")
_A_PIN: Final = f'a BCM pin from 0 to {HIGHEST_BCM}, such as 22, "GPIO22" or "BOARD15"'


@dataclass(frozen=True, slots=True)
class Key:
    """One key of a table.

    Attributes:
        name: Its name, which ends with the unit.
        kind: What it holds.
        default: What it is where it is left out; `REQUIRED` for a key that may not be.
        low: Smallest number.
        high: Largest number; infinity goes with `above`.
        above: Whether `low` itself is too small.
        names: What a "choice" may be.
        longest: Most characters of a text.
    """

    name: str
    kind: Kind
    default: Any = REQUIRED
    low: float = 0.0
    high: float = math.inf
    above: bool = False
    names: tuple[str, ...] = ()
    longest: int = _LONGEST_TEXT

    @property
    def wanted(self) -> str:
        """What it must be, in words."""
        unit = unit_of(self.name)
        match self.kind:
            case "number":
                return f"a number{self._range()}{f' ({unit})' if unit else ''}"
            case "whole":
                return f"a whole number{self._range()}{f' ({unit})' if unit else ''}"
            case "text":
                return f"a text of 1 to {self.longest} characters that can be printed"
            case "truth":
                return "true or false"
            case "pin":
                return _A_PIN if self.default != NO_PIN else f"{_A_PIN}, or {NO_PIN} for none"
            case "pins":
                return f"a list of pins, each {_A_PIN}"
            case "size":
                low, high = int(self.low), int(self.high)
                return f"[width, height] in pixels, each an even number from {low} to {high}"
            case "weights":
                return f"a table of numbers{self._range()} by name of action"
            case "date":
                return "a date, such as 2026-11-03"
            case "choice":
                return f"one of {', '.join(repr(name) for name in self.names if name)}"

    def value_of(self, written: Any) -> Any:
        """The value, as plans have it.

        Raises:
            ValueError: If it is not what the key may hold; the message goes on after `wanted`.
        """
        try:
            return self._value_of(written)
        except ValueError as error:
            raise ValueError(str(error) or f"not {shown(written)}") from None

    def _value_of(self, written: Any) -> Any:
        match self.kind:
            case "number":
                return self._number(written)
            case "whole":
                if type(written) is not int:
                    raise ValueError
                self._number(written)
                return written
            case "pin":
                if type(written) is int and written == self.default == NO_PIN:
                    return NO_PIN
                return bcm(written)
            case "pins":
                return self._pins(written)
            case "size":
                return self._size(written)
            case "weights":
                return self._weights(written)
            case "choice":
                if not isinstance(written, str):
                    raise ValueError
                if written not in self.names:
                    raise ValueError(f"not {written!r}{nearest(written, self.names)}")
            case "text":
                ok = isinstance(written, str) and 1 <= len(written) <= self.longest
                if not ok or _NOT_PRINTABLE.search(written) or not written.strip():
                    raise ValueError
            case "truth":
                if not isinstance(written, bool):
                    raise ValueError
            case "date":
                if not isinstance(written, date) or isinstance(written, datetime):
                    raise ValueError
        return written

    def _range(self) -> str:
        low, high = f"{self.low:g}", f"{self.high:g}"
        if math.isinf(self.high):
            return f" above {low}"
        return f" above {low} and up to {high}" if self.above else f" from {low} to {high}"

    def _number(self, written: Any) -> float:
        if type(written) not in (int, float):
            raise ValueError
        # Written so that NaN is refused.
        if not self.low <= written <= self.high or (self.above and written == self.low):
            raise ValueError
        try:
            return float(written)
        except OverflowError:
            raise ValueError from None

    def _pins(self, written: Any) -> list[int]:
        if not isinstance(written, list) or not written:
            raise ValueError
        pins: list[int] = []
        for pin in cast("list[Any]", written):
            try:
                pins.append(bcm(pin))
            except ValueError as error:
                raise ValueError(str(error) or f"and {shown(pin)} is none") from None
        return pins

    def _size(self, written: Any) -> tuple[int, int]:
        if not isinstance(written, list):
            raise ValueError
        sides = cast("list[Any]", written)
        if len(sides) != 2 or any(type(side) is not int or side % 2 for side in sides):
            raise ValueError
        width, height = (int(self._number(side)) for side in sides)
        return width, height

    def _weights(self, written: Any) -> dict[str, float]:
        if not isinstance(written, dict):
            raise ValueError
        weights: dict[str, float] = {}
        for name, weight in cast("dict[str, Any]", written).items():
            try:
                weights[name] = self._number(weight)
            except ValueError:
                raise ValueError(f"and the one of {name} is {shown(weight)}") from None
        return weights
