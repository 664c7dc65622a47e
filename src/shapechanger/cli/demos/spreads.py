"""Which numbers of a recording are shown, and how they are spread."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final

from shapechanger.demos.episodes import Episode
from shapechanger.demos.statistics import Spread, spread
from shapechanger.demos.statistics.episodes import gaps_s
from shapechanger.layout import Layout

__all__ = ["spreads"]

# Of a state, what people want to know first; what the outputs did is shown with the actions.
_SENSED: Final = ("speed", "distance", "battery")
_MS: Final = 1e3
_MOST_ACTIONS: Final = 12


def spreads(episodes: Sequence[Episode]) -> list[tuple[str, str, Spread]]:
    """Name, unit and spread of the actions, of what was sensed, and of the time between steps.

    Numbers of the same name and unit are taken together, whatever episode they are of.
    """
    found: dict[tuple[str, str], tuple[list[float], float, float]] = {}

    def add(name: str, unit: str, values: Iterable[float], low: float, high: float) -> None:
        numbers, *_ = found.setdefault((name, unit), ([], low, high))
        numbers.extend(values)

    for episode in episodes:
        actions = Layout.from_json(episode.header.action_layout)
        for name, place in list(actions.slices.items())[:_MOST_ACTIONS]:
            of_one = (v for step in episode.kept for v in step.action[place])
            add(name, actions[name].unit, of_one, actions[name].low, actions[name].high)
    for episode in episodes:
        if not episode.header.state_layout:
            continue
        states = Layout.from_json(episode.header.state_layout)
        for name in (n for n in _SENSED if n in states):
            place = states.slices[name]
            of_one = (v for step in episode.kept for v in step.state[place])
            add(name, states[name].unit, of_one, float("-inf"), float("inf"))
    for episode in episodes:
        times = (_MS * gap for gap in gaps_s(episode))
        add("time between steps", "ms", times, float("-inf"), float("inf"))
    counted = [
        (name, unit, spread(values, low, high))
        for (name, unit), (values, low, high) in found.items()
    ]
    return [(name, unit, one) for name, unit, one in counted if one is not None]
