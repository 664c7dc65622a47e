"""The units that the keys of a profile carry in their names."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

__all__ = ["UNITS", "stem_of", "unit_of", "with_unit"]

UNITS: Final = {
    "_deg_per_s": "degrees a second",
    "_per_s": "per second",
    "_hz": "hertz",
    "_ms": "milliseconds",
    "_us": "microseconds",
    "_m": "metres",
    "_s": "seconds",
    "_v": "volts",
    "_c": "degrees Celsius",
}
"""What the end of a key says, longest first."""

# What people write instead.
_OTHER_ENDS: Final = ("_deg", "_rad", "_cm", "_mm", "_km", "_mv", "_f", "_sec", "_khz", "_min")


def unit_of(key: str) -> str:
    """The unit that the name of a key ends with, in words; empty for none."""
    return next((unit for end, unit in UNITS.items() if key.endswith(end)), "")


def stem_of(key: str) -> str:
    """The name of a key without any unit."""
    return next((key.removesuffix(e) for e in (*UNITS, *_OTHER_ENDS) if key.endswith(e)), key)


def with_unit(key: str, known: Iterable[str]) -> str | None:
    """The known key that is meant by one with no unit or another one; None for none."""
    return next((k for k in known if unit_of(k) and stem_of(k) == stem_of(key)), None)
