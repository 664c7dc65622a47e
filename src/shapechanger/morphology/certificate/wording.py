"""One difference between two models, in numbers and in a sentence."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Final

import msgspec

__all__ = ["Amount", "Change", "change", "grouped"]

Amount = float | str | tuple[float | str, ...] | None
"""A number, a word, some of them, or None for what is not there."""

# A change of one of these is of the element as a whole: it is there on one side only.
_WHOLE: Final = frozenset(
    (
        "body",
        "joint",
        "geom",
        "site",
        "contact",
        "actuator",
        "tendon",
        "equality constraint",
        "flex",
        "plugin",
    )
)
# Ratios of these mean nothing.
_WITHOUT_RATIO: Final = frozenset(("orientation", "inertia axes", "axis", "dimensions"))
_DIGITS: Final = (4, 8, 17)


class Change(msgspec.Struct, frozen=True):
    """What is different in the target.

    Attributes:
        quantity: What changed, such as "mass", "length", "contact friction" or "gear"; the kind of
            element, such as "body", where the element is there on one side only.
        element: Name of the element that it belongs to; names, with commas, in a group.
        before: Value in the source; None if it has none.
        after: Value in the target; None if it has none.
        unit: Unit of both; "1" for a pure number, empty for words and for mixed units.
        sentence: The change for a reader.
    """

    quantity: str
    element: str
    before: Amount
    after: Amount
    unit: str
    sentence: str


def change(
    quantity: str,
    element: str,
    before: Sequence[float | str] | None,
    after: Sequence[float | str] | None,
    unit: str = "",
) -> Change:
    """A change with its sentence; a value of one number stands for the number."""
    old, new = _plain(before), _plain(after)
    return Change(
        quantity, element, old, new, unit, f"{element}: {_words(quantity, old, new, unit)}"
    )


def grouped(changes: Iterable[Change]) -> tuple[Change, ...]:
    """The changes for reading: those that say the same of several elements become one."""
    groups: dict[tuple[str, str], list[Change]] = {}
    for item in changes:
        said = item.sentence.removeprefix(f"{item.element}: ")
        groups.setdefault((item.quantity, said), []).append(item)
    merged: list[Change] = []
    for (_, said), members in groups.items():
        names = ", ".join(member.element for member in members)
        merged.append(
            msgspec.structs.replace(members[0], element=names, sentence=f"{names}: {said}")
        )
    return tuple(merged)


def _plain(values: Sequence[float | str] | None) -> Amount:
    """What JSON can hold: one value for itself, and no infinite number."""
    if values is None:
        return None
    finite = tuple(
        value if isinstance(value, str) or math.isfinite(value) else str(value) for value in values
    )
    return finite[0] if len(finite) == 1 else finite


def _words(quantity: str, before: Amount, after: Amount, unit: str) -> str:
    """What a sentence says after the name of the element."""
    suffix = f" {unit}" if unit not in ("", "1") else ""
    if quantity in _WHOLE:
        there = before if after is None else after
        return (
            f"{quantity} {'removed' if after is None else 'added'} "
            f"({_shown(there, _DIGITS[0])}{suffix})"
        )
    old, new = "", ""
    for digits in _DIGITS:  # As many digits as it takes to tell the two apart.
        old, new = _shown(before, digits), _shown(after, digits)
        if old != new:
            break
    old, new = (text if text == "none" else f"{text}{suffix}" for text in (old, new))
    ratio = None if quantity in _WITHOUT_RATIO else _ratio(before, after)
    times = "" if ratio is None else f" (x{ratio:.3g})"
    return f"{quantity} {old} -> {new}{'' if times == ' (x1)' else times}"


def _shown(amount: Amount, digits: int) -> str:
    """An amount with so many significant digits; equal numbers of a list are shown once."""
    if amount is None:
        return "none"
    if not isinstance(amount, tuple):
        return amount if isinstance(amount, str) else f"{amount:.{digits}g}"
    texts = [_shown(value, digits) for value in amount]
    if not texts:
        return "none"
    return f"{texts[0]} each" if len(set(texts)) == 1 else f"({', '.join(texts)})"


def _ratio(before: Amount, after: Amount) -> float | None:
    """New over old, if it is the same for all numbers that are not zero in both."""
    old = before if isinstance(before, tuple) else (before,)
    new = after if isinstance(after, tuple) else (after,)
    if len(old) != len(new):
        return None
    ratios: list[float] = []
    for a, b in zip(old, new, strict=True):
        if not isinstance(a, float) or not isinstance(b, float) or (a == 0.0) != (b == 0.0):
            return None
        if a != 0.0:
            ratios.append(b / a)
    # Three digits are shown, so ratios that agree to four are one ratio.
    same = all(math.isclose(ratio, ratios[0], rel_tol=1e-4) for ratio in ratios)
    return ratios[0] if ratios and same else None
