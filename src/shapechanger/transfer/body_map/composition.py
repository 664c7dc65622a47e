"""Maps in a row, and maps backwards, as arithmetic of rules."""

from __future__ import annotations

from collections.abc import Sequence

from shapechanger.errors import MapError
from shapechanger.layout import Feature
from shapechanger.transfer.body_map.entries import BY_DEFAULT, SAME_NAME, Entry, Side
from shapechanger.transfer.body_map.matching import constant_rule
from shapechanger.transfer.body_map.rules import RuleLike, Take, substituted

__all__ = ["chained", "inverted"]


def chained(outer: Sequence[Entry], inner: Sequence[Entry]) -> tuple[Entry, ...]:
    """Replace each feature that `outer` takes by what `inner` fills it with."""
    filled_by = {entry.feature: entry for entry in inner}
    result: list[Entry] = []
    for entry in outer:
        if isinstance(entry.rule, Take):
            through = filled_by[entry.rule.feature]
            reasons = [why for why in (entry.why, through.why) if why != SAME_NAME]
            rule = substituted(entry.rule, through.rule)
            result.append(Entry(entry.feature, rule, ", then ".join(reasons) or SAME_NAME))
        else:
            result.append(entry)
    return tuple(result)


def inverted(side: Side, entries: Sequence[Entry], otherwise: RuleLike) -> tuple[Entry, ...]:
    """For each feature of `side.over` a rule over `side.into`.

    Raises:
        MapError: If a feature is taken more than once, and by none of the same name.
    """
    takers: dict[str, list[tuple[Entry, float]]] = {}
    for entry in entries:
        if isinstance(entry.rule, Take):
            takers.setdefault(entry.rule.feature, []).append((entry, entry.rule.scale))
    return tuple(
        _backwards(feature, takers.get(feature.name, []), otherwise) for feature in side.over
    )


def _backwards(feature: Feature, takers: list[tuple[Entry, float]], otherwise: RuleLike) -> Entry:
    """The entry that gives `feature` back from what took it."""
    if not takers:
        return Entry(feature.name, constant_rule(otherwise, feature), BY_DEFAULT)
    namesakes = [taker for taker in takers if taker[0].feature == feature.name]
    if len(takers) > 1 and not namesakes:
        names = " and ".join(repr(entry.feature) for entry, _ in takers)
        raise MapError(
            f"{feature.name!r} is taken by {names}, and none of them bears its name: "
            "the way back is not unique."
        )
    entry, scale = (namesakes or takers)[0]
    return Entry(feature.name, Take(entry.feature, 1.0 / scale), entry.why)
