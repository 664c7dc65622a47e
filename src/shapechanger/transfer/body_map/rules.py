"""The four rules by which one number of a body follows from the numbers of another.

No rule adds an offset to what it takes, so two rules in a row are one rule again.

>>> substituted(Take("shin", 2.0), Take("shank", -1.5))
Take(feature='shank', scale=-3.0)
>>> substituted(Take("shin", 2.0), Hold(0.5))
Hold(value=1.0)
"""

from __future__ import annotations

import math

import msgspec

from shapechanger.errors import MapError

__all__ = ["Hold", "Learn", "Rule", "RuleLike", "Take", "Zero", "in_words", "substituted"]


class Take(msgspec.Struct, frozen=True, tag="take", omit_defaults=True):
    """Take the number of another feature, times a scale.

    A partner of the same name, a copied sibling and a mirror partner are all this rule.

    Attributes:
        feature: Name of the feature that is taken; a block is copied as a whole.
        scale: What the number is multiplied by, finite and not zero; -1 for a mirror partner whose
            coordinate changes sign.

    Raises:
        MapError: If the scale is zero or not finite.
    """

    feature: str
    scale: float = 1.0

    def __post_init__(self) -> None:
        if not math.isfinite(self.scale) or self.scale == 0.0:
            raise MapError(
                f"The scale of {self.feature!r} must be finite and not zero, got {self.scale}: "
                "write the rule 'zero' for a number that is always 0."
            )


class Zero(msgspec.Struct, frozen=True, tag="zero"):
    """Always 0."""


class Hold(msgspec.Struct, frozen=True, tag="hold"):
    """Always the same number.

    Attributes:
        value: That number, in the unit of the feature that it fills; finite.

    Raises:
        MapError: If the value is not finite.
    """

    value: float

    def __post_init__(self) -> None:
        if not math.isfinite(self.value):
            raise MapError(f"The value to hold must be finite, got {self.value}.")


class Learn(msgspec.Struct, frozen=True, tag="learn"):
    """0 until it is trained: a transplanted policy gets fresh weights here."""


Rule = Take | Zero | Hold | Learn

RuleLike = Rule | str
"""A rule, or one in words: "zero", "hold" (the middle of the range), "learn", "copy NAME"."""


def in_words(rule: Rule) -> str:
    """The rule as a person would say it, such as `hip_4/angle times -1`."""
    match rule:
        case Take(feature, scale):
            return feature if scale == 1.0 else f"{feature} times {scale:g}"
        case Zero():
            return "zero"
        case Hold(value):
            return f"hold {value:g}"
        case Learn():
            return "learn"


def substituted(outer: Take, inner: Rule) -> Rule:
    """The one rule that does `inner` and then scales the result as `outer` does."""
    match inner:
        case Take(feature, scale):
            return Take(feature, outer.scale * scale)
        case Hold(value):
            return Hold(outer.scale * value)
        case Zero() | Learn():
            return inner
