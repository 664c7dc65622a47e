"""A control: fine-tune through a body map whose entries are shuffled."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import msgspec
import numpy as np

from shapechanger.layout import Layout
from shapechanger.transfer.body_map import BodyMap
from shapechanger.transfer.body_map.rules import Copy, MapEntry
from shapechanger.transfer.methods import Method, MethodRun

_WHY = "shuffled"


class ShuffledMap(Method):
    """Fine-tune through a body map with exchanged entries: a control of what the map contributes.

    A gain that remains does not depend on which inputs and outputs correspond.
    """

    name = "shuffled-map"

    def learn(self, run: MethodRun) -> Any:
        """Train on the target, starting from the source policy."""
        return run.fine_tune(body_map=shuffle(run.body_map, np.random.default_rng(run.seed)))


def shuffle(body_map: BodyMap, rng: np.random.Generator) -> BodyMap:
    """Return a body map with the same rules, each at another entry."""
    return msgspec.structs.replace(
        body_map,
        observation=_shuffled(body_map.observation, body_map.source_observation, rng),
        action=_shuffled(body_map.action, body_map.target_action, rng),
    )


def _shuffled(
    entries: Sequence[MapEntry], layout: Layout, rng: np.random.Generator
) -> tuple[MapEntry, ...]:
    """Exchange the rules that copy features of the same shape; the others stay."""
    places: dict[tuple[int, ...], list[int]] = {}
    for i, entry in enumerate(entries):
        if isinstance(entry.rule, Copy):
            places.setdefault(layout[entry.feature].shape, []).append(i)
    result = list(entries)
    for exchangeable in places.values():
        order: list[int] = rng.permutation(exchangeable).tolist()
        for place, taken in zip(exchangeable, order, strict=True):
            result[place] = MapEntry(entries[place].feature, entries[taken].rule, _WHY)
    return tuple(result)
