"""One half of a body map: each feature of one layout with its rule over another layout."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final, Literal, NamedTuple

from shapechanger.errors import MapError, UnknownName
from shapechanger.layout import Feature, Layout
from shapechanger.transfer.body_map.rules import Rule, Take

__all__ = ["BY_DEFAULT", "SAME_NAME", "Entry", "Side", "SideName", "check_entries", "same_meaning"]

SideName = Literal["observation", "action"]

SAME_NAME: Final = "same name"
BY_DEFAULT: Final = "default"


@dataclass(frozen=True, slots=True)
class Entry:
    """One feature and the rule that fills it.

    Two entries are equal if they do the same; where a rule came from is a remark.

    Attributes:
        feature: Name of the feature that is filled.
        rule: What fills it.
        why: Where the rule came from: "same name", "rule 'foot_*'", "default" or "symmetry".
    """

    feature: str
    rule: Rule
    why: str = field(default=BY_DEFAULT, compare=False)


class Side(NamedTuple):
    """Which layout is filled, and from which.

    Attributes:
        name: "observation" or "action".
        into: The layout that is filled: the source's observation, or the target's action.
        over: The layout that it is filled from: the target's observation, or the source's action.
    """

    name: SideName
    into: Layout
    over: Layout

    @property
    def into_kind(self) -> str:
        """What a feature of `into` is called in a message."""
        owner = "source" if self.name == "observation" else "target"
        return f"{owner} {self.name} feature"

    @property
    def over_kind(self) -> str:
        """What a feature of `over` is called in a message."""
        owner = "target" if self.name == "observation" else "source"
        return f"{owner} {self.name} feature"

    def taken(self, name: str) -> Feature:
        """The feature of `over` that a rule takes.

        Raises:
            UnknownName: If there is none.
        """
        if name not in self.over:
            raise UnknownName(self.over_kind, name, self.over.names)
        return self.over[name]


def check_entries(side: Side, entries: tuple[Entry, ...]) -> None:
    """See that each feature has its one rule, in order, and that what is taken exists and fits.

    Raises:
        MapError: If a feature has no rule, is out of place, or takes a block of another shape.
        UnknownName: If a rule takes a feature that is not there.
    """
    filled = tuple(entry.feature for entry in entries)
    if filled != side.into.names:
        raise MapError(
            f"Each {side.into_kind} needs one rule, in the order of the layout: "
            f"{', '.join(side.into.names)}; the rules given are for {', '.join(filled) or 'none'}."
        )
    for feature, entry in zip(side.into, entries, strict=True):
        if isinstance(entry.rule, Take):
            taken = side.taken(entry.rule.feature)
            if taken.shape != feature.shape:
                raise MapError(
                    f"{feature.name!r} has the shape {feature.shape} and cannot take "
                    f"{taken.name!r}, which has the shape {taken.shape}."
                )


def same_meaning(left: Layout, right: Layout) -> str:
    """Empty if the numbers of both layouts mean the same; otherwise where they first differ.

    Ranges may differ, since a longer leg only widens them; names, order, units, shapes and gains
    may not.
    """
    for place, (a, b) in enumerate(zip(left, right, strict=False)):
        for aspect in ("name", "unit", "shape", "gain", "gain_unit"):
            ours, theirs = getattr(a, aspect), getattr(b, aspect)
            if ours != theirs:
                return f"feature {place} is {a} and {b}, whose {aspect} is {ours!r} and {theirs!r}"
    if len(left) != len(right):
        return f"one has {len(left)} features and the other {len(right)}"
    return ""
