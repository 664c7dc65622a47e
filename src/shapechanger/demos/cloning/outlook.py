"""Collision rates to expect of a clone, from those of clones of as much driving."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.cloning.card import CloneCard


class Driven(NamedTuple):
    """Collision rate of clones of the simulated expert on courses that they had not seen.

    Attributes:
        minutes: Length of the demonstrations, min.
        per_100_m: Collisions per 100 m, over all seeds.
        by_seed: The same of each clone; () for a single one.
        row: Beginning of the row in benchmarks/results/corrections.json.
    """

    minutes: int
    per_100_m: float
    by_seed: tuple[float, ...]
    row: str


# Measured by `python -m benchmarks.run corrections`: 9 km of held-out corridors each.
EXPERT: Final = (
    Driven(2, 3.52, (5.89, 2.33, 2.33), "car, 3 seeds, cloned from 2 minutes of the expert"),
    Driven(4, 1.06, (1.63, 0.80, 0.77), "car, 3 seeds, after 2 more of the expert instead"),
    Driven(10, 0.84, (), "car, cloned from 10 minutes of the expert"),
)
"""Clones of the expert's driving alone, by its length."""
CORRECTED: Final = (
    Driven(4, 0.91, (1.10, 0.63, 1.00), "car, 3 seeds, after a round of 2 minutes of corrections"),
    Driven(20, 0.38, (), "car, after a round of 10 minutes of corrections"),
)
"""Clones of the expert and of its corrections, half of the length each."""
_MINUTE_S: Final = 60.0


@dataclass(frozen=True, slots=True)
class Outlook:
    """Collisions to expect of a policy before it drives.

    Attributes:
        minutes: Length of the driving that it learned from, min.
        expected: A sentence on the collisions of clones of as much driving, with its source.
        next_step: A sentence on the next step.
    """

    minutes: float
    expected: str
    next_step: str


def duration_s(times_s: NDArray[np.float64], episodes: Sequence[int], control_hz: float) -> float:
    """Return the length of demonstrations, s, by their times.

    Args:
        times_s: Time of each step since the start of its episode, s, shape (n,).
        episodes: Number of steps of each episode, in order.
        control_hz: Steps per second; the last step of an episode takes the inverse.
    """
    total, end = 0.0, 0
    for length in episodes:
        end += length
        total += float(times_s[end - 1]) - float(times_s[end - length])
    return total + (len(episodes) / control_hz if control_hz > 0.0 else 0.0)


def outlook(card: CloneCard) -> Outlook | None:
    """Return the collisions to expect of a cloned driver, from its card.

    Returns:
        None if the policy does not steer by pictures, or its card has no `learned_s`. The rates are
        those of a car in corridors; no other clones were measured in this way.
    """
    learned_s = card.data.get("learned_s", 0.0)
    names = () if card.action_layout is None else card.action_layout.names
    steers = "steering" in names or {"left", "right"} <= set(names)
    known = isinstance(learned_s, int | float) and math.isfinite(learned_s) and learned_s > 0.0
    if not (steers and known) or card.eyes == "none":
        return None
    minutes = round(learned_s / _MINUTE_S, 1)
    return Outlook(
        minutes,
        f"It learned from {minutes:.1f} minutes of driving, so expect {_rate(minutes)} per 100 m "
        "where it has not driven. That is what clones of a car's simulated expert had in corridors "
        "(docs/cloning.md); a person with keys is less steady, so expect more of its clone.",
        _next_step(minutes),
    )


def _rate(minutes: float) -> str:
    """Return the collision rate between those of the nearest lengths that were measured."""
    less = [row for row in EXPERT if row.minutes <= minutes]
    more = [row for row in EXPERT if row.minutes > minutes]
    if not less:
        return f"more than {_described(more[0])} collisions"
    if not more:
        return f"about {_described(less[-1])} collisions or fewer"
    return f"{more[0].per_100_m:.1f} to {_described(less[-1])} collisions"


def _described(row: Driven) -> str:
    """Return a rate with the worst seed's."""
    if not row.by_seed:
        return f"{row.per_100_m:.1f}"
    return f"{row.per_100_m:.1f} ({max(row.by_seed):.1f} for the worst of {len(row.by_seed)} seeds)"


def _next_step(minutes: float) -> str:
    after = next((row for row in CORRECTED if row.minutes > minutes), CORRECTED[-1])
    half = after.minutes // 2
    correct = (
        "let it drive and correct it (`demos record ENV --driver POLICY --corrected-by expert`, or "
        "take over at the console of a robot), merge, and train again: "
        f"{after.per_100_m:.1f} per 100 m after {half} minutes of driving and {half} of corrections"
    )
    # The rate of the shortest length is too high to aim at.
    longer = next((row for row in EXPERT[1:] if row.minutes > minutes), None)
    if longer is None:
        return f"Next: {correct}."
    return (
        f"Next: record more ({longer.per_100_m:.1f} per 100 m after {longer.minutes} minutes), or "
        f"{correct}."
    )
