"""The four rules of a body map, its entries, and their arithmetic.

No rule adds an offset to a copied value, so a composition of two rules is again a rule.

>>> compose_rules(Copy("shin", 2.0), Copy("shank", -1.5))
Copy(feature='shank', scale=-3.0)
>>> compose_rules(Copy("shin", 2.0), Hold(0.5))
Hold(value=1.0)
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Final, Literal, NamedTuple

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from shapechanger.errors import MapError, SpaceMismatch, UnknownName
from shapechanger.layout import Feature, Layout


class Copy(msgspec.Struct, frozen=True, tag="take", omit_defaults=True):
    """A copy of another feature, multiplied by a scale.

    Attributes:
        feature: Name of the feature that is copied; a block is copied as a whole.
        scale: Factor, finite and not zero; -1 for a mirror partner whose coordinate changes sign.

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
    """A constant.

    Attributes:
        value: The constant, in the unit of the feature that it fills; finite.

    Raises:
        MapError: If the value is not finite.
    """

    value: float

    def __post_init__(self) -> None:
        if not math.isfinite(self.value):
            raise MapError(f"The value to hold must be finite, got {self.value}.")


class Learn(msgspec.Struct, frozen=True, tag="learn"):
    """0 until trained: a transplanted policy gets new weights here."""


Rule = Copy | Zero | Hold | Learn

RuleLike = Rule | str
"""A rule, or its short form: "zero", "hold" (the middle of the range), "learn", "copy NAME"."""


def describe_rule(rule: Rule) -> str:
    """Return a rule as text, such as `hip_4/angle times -1`."""
    match rule:
        case Copy(feature, scale):
            return feature if scale == 1.0 else f"{feature} times {scale:g}"
        case Zero():
            return "zero"
        case Hold(value):
            return f"hold {value:g}"
        case Learn():
            return "learn"


def compose_rules(outer: Copy, inner: Rule) -> Rule:
    """Return the rule that applies `inner` and then the scale of `outer`."""
    match inner:
        case Copy(feature, scale):
            return Copy(feature, outer.scale * scale)
        case Hold(value):
            return Hold(outer.scale * value)
        case Zero() | Learn():
            return inner


_TOKEN: Final = re.compile(r"\[!?+\]?+[^\]]*\]|.", re.DOTALL)


def expand_template(template: str, pattern: str, name: str) -> str:
    """Replace each `*` of `template`, in order, by the text that a wildcard of `pattern` matches.

    >>> expand_template("ankle_*/motor", "foot_*/motor", "foot_2/motor")
    'ankle_2/motor'
    """
    if "*" not in template:
        return template

    def as_group(token: str) -> str:
        """Translate one token of a glob to a regular expression; a wildcard becomes a group."""
        if token in ("*", "?"):
            return "(.*)" if token == "*" else "(.)"
        if len(token) > 1:
            inside = token[1:-1].replace("\\", r"\\")
            return f"([^{inside[1:]}])" if inside.startswith("!") else f"([{inside}])"
        return re.escape(token)

    fit = re.fullmatch("".join(map(as_group, _TOKEN.findall(pattern))), name, re.DOTALL)
    found = fit.groups() if fit else ()
    if len(found) != template.count("*"):
        raise MapError(
            f"{template!r} must have a star for each wildcard of {pattern!r}, which has "
            f"{len(found)}."
        )
    literal = template.split("*")
    return "".join(a + b for a, b in zip(literal, (*found, ""), strict=True))


SideName = Literal["observation", "action"]

SAME_NAME: Final = "same name"
BY_DEFAULT: Final = "default"


@dataclass(frozen=True, slots=True)
class MapEntry:
    """One feature and the rule that fills it.

    Equality ignores `why`.

    Attributes:
        feature: Name of the feature that is filled.
        rule: The rule.
        why: Origin of the rule, such as "same name", "rule 'foot_*'", "default" or "symmetry".
    """

    feature: str
    rule: Rule
    why: str = field(default=BY_DEFAULT, compare=False)


class Side(NamedTuple):
    """One half of a map: a layout that is filled, and the one that it is filled from."""

    name: SideName
    into: Layout
    over: Layout

    @property
    def into_kind(self) -> str:
        """Name of a feature of `into` in messages."""
        return f"{'source' if self.name == 'observation' else 'target'} {self.name} feature"

    @property
    def over_kind(self) -> str:
        """Name of a feature of `over` in messages."""
        return f"{'target' if self.name == 'observation' else 'source'} {self.name} feature"

    def copied(self, name: str) -> Feature:
        """Return the feature of `over` that a rule copies."""
        if name not in self.over:
            raise UnknownName(self.over_kind, name, self.over.names)
        return self.over[name]


def difference_in_meaning(left: Layout, right: Layout) -> str:
    """Describe the first difference in meaning between two layouts; empty if they agree.

    Names, order, units, shapes and gains are compared. Ranges are not, because a longer leg widens
    them without changing their meaning.
    """
    for place, (a, b) in enumerate(zip(left, right, strict=False)):
        for aspect in ("name", "unit", "shape", "gain", "gain_unit"):
            ours, theirs = getattr(a, aspect), getattr(b, aspect)
            if ours != theirs:
                return f"feature {place} is {a} and {b}, whose {aspect} is {ours!r} and {theirs!r}"
    if len(left) != len(right):
        return f"one has {len(left)} features and the other {len(right)}"
    return ""


class Half:
    """One half of a map: a rule for each feature of a side, in vectorised form.

    A number that is copied with scale 1 is bitwise equal to the original.

    Attributes:
        side: The layouts.
        entries: One for each feature of `side.into`, in order.
        offset: Constant of each output, 0 for copied ones, shape (n_into,); read-only.

    Raises:
        MapError: If a feature has no rule, or copies a block of another shape.
        UnknownName: If a rule copies a feature that does not exist.
    """

    def __init__(self, side: Side, entries: tuple[MapEntry, ...]) -> None:
        self.side, self.entries = side, entries
        names = tuple(entry.feature for entry in entries)
        if names != side.into.names:
            raise MapError(
                f"Each {side.into_kind} needs one rule, in the order of the layout: "
                f"{', '.join(side.into.names)}; the rules given are for "
                f"{', '.join(names) or 'none'}."
            )
        self.offset, self._n_over = np.zeros(side.into.size), side.over.size
        into, over = side.into.slices, side.over.slices
        rows, columns, scale = list[int](), list[int](), list[float]()
        for entry in entries:
            place = into[entry.feature]
            match entry.rule:
                case Copy(feature, factor):
                    filled, copied = side.into[entry.feature], side.copied(feature)
                    if copied.shape != filled.shape:
                        raise MapError(
                            f"{filled.name!r} has the shape {filled.shape} and cannot copy "
                            f"{copied.name!r}, which has the shape {copied.shape}."
                        )
                    rows += range(place.start, place.stop)
                    columns += range(over[feature].start, over[feature].stop)
                    scale += [factor] * (place.stop - place.start)
                case Hold(value):
                    self.offset[place] = value
                case Zero() | Learn():
                    pass
        self.offset.setflags(write=False)
        # Output indices that are copied, their input indices and their factors.
        self._rows, self._columns = np.array(rows, np.intp), np.array(columns, np.intp)
        self._scale = np.array(scale, np.float64)

    def __call__(self, values: ArrayLike) -> NDArray[Any]:
        """Apply the map to each input vector.

        Args:
            values: Shape (..., n_over).

        Returns:
            A new array of shape (..., n_into): float32 for float32, float64 for float64 and for
            integers that float32 cannot hold.
        """
        given = np.asarray(values)
        if given.shape[-1:] != (self._n_over,):
            raise SpaceMismatch(
                f"The layout of {self.side.over_kind}s has {self._n_over} numbers, so the last "
                f"axis must have that length, and the shape is {given.shape}."
            )
        dtype = np.result_type(given.dtype, np.float32)
        filled = np.empty((*given.shape[:-1], self.offset.size), dtype)
        filled[...] = self.offset
        filled[..., self._rows] = given[..., self._columns] * self._scale
        return filled

    @cached_property
    def matrix(self) -> NDArray[np.float64]:
        """The linear part, shape (n_into, n_over); read-only."""
        dense = np.zeros((self.offset.size, self._n_over))
        dense[self._rows, self._columns] = self._scale
        dense.setflags(write=False)
        return dense
