"""Evaluation of a policy: on held-out demonstrations, and the collisions to expect of it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.cloning.card import CloneCard, Head, class_numbers
from shapechanger.demos.cloning.pictures import CloningError
from shapechanger.layout import Layout

if TYPE_CHECKING:
    from shapechanger.demos.cloning.policy import CameraPolicy
    from shapechanger.demos.dataset import Dataset

AskedHead = Literal["auto", "class", "regression"]
"""Requested kind of output; "auto" uses classes if few different actions were demonstrated."""

_MOST_CLASSES: Final = 16  # More different actions are continuous.
_MIN_REPEATS: Final = 4  # Average number of occurrences of each action for classes.
# Maximum error of a value within the tolerance, as a share of half its range.
_TOLERANCE: Final = 0.1
_BINS: Final = 10
_WORST: Final = 12
_MAX_POINTS: Final = 2000  # Enough for a chart.
_WORDS: Final = {
    "steering": ("left", "straight", "right"),
    "throttle": ("back", "still", "forward"),
}
_PLACES: Final = ("low", "middle", "high")
OUT_OF_RANGE: Final = "out of range"
"""Class of an action that is in no third."""


def tercile_classes(
    actions: NDArray[np.float64], layout: Layout, driver: NDArray[np.float64] | None = None
) -> tuple[list[str], NDArray[np.int64]]:
    """Return the third of its range that each value is in, one class per combination that occurs.

    An action with a value outside its range, by more than the tolerance, is in the class
    `OUT_OF_RANGE`.

    Args:
        actions: Shape (n, m).
        layout: Meaning of the values.
        driver: The driver's actions, shape (n, m), whose extremes replace missing bounds; None for
            `actions`.

    Returns:
        The names of the classes, and the class index of each action, shape (n,).
    """
    low, high = _ranges(actions if driver is None else driver, layout)
    share = (actions - low) / np.where(high > low, high - low, 1.0)
    third = (share > 1.0 / 3.0).astype(np.int64) + (share > 2.0 / 3.0)
    outside = ~(np.abs(share - 0.5) <= 0.5 * (1.0 + _TOLERANCE)).all(axis=1)
    third[outside] = -1
    found, numbers = np.unique(third, axis=0, return_inverse=True)
    parts = [name for feature in layout for name in [feature.name] * feature.size]
    names = [
        OUT_OF_RANGE
        if row[0] < 0
        else " ".join(_word(name, int(place)) for name, place in zip(parts, row, strict=True))
        for row in found
    ]
    return names, numbers.reshape(-1).astype(np.int64)


def _ranges(
    actions: NDArray[np.floating], layout: Layout
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the bounds of each value; the extreme action replaces a missing bound."""
    low = np.where(np.isfinite(layout.low), layout.low, actions.min(axis=0))
    return low, np.where(np.isfinite(layout.high), layout.high, actions.max(axis=0))


def _word(name: str, third: int) -> str:
    words = _WORDS.get(name.split("/")[-1])
    return words[third] if words else f"{name} {_PLACES[third]}"


def output_fields(
    actions: NDArray[np.float32],
    layout: Layout,
    asked: AskedHead,
    mirrored: NDArray[np.float32] | None = None,
) -> dict[str, Any]:
    """Choose the output encoding from the demonstrated actions, as fields of a `CloneCard`.

    Args:
        actions: Actions of the driver, shape (n, m).
        layout: Meaning of the values.
        asked: Requested kind of output.
        mirrored: The mirrored actions, if images are mirrored; None if not.

    Raises:
        CloningError: If there are too many different actions for classes, or all are equal.
    """
    both = actions if mirrored is None else np.concatenate((actions, mirrored))
    different, counts = np.unique(both, axis=0, return_counts=True)
    few = len(different) <= _MOST_CLASSES and _MIN_REPEATS * len(different) <= len(actions)
    if asked == "class" and len(different) > _MOST_CLASSES:
        raise CloningError(
            f"There are {len(different)} different actions, but at most {_MOST_CLASSES} classes "
            "are supported: choose the head regression."
        )
    if len(np.unique(actions, axis=0)) < 2 and asked != "regression":
        raise CloningError(
            f"All of {len(actions)} actions are equal ({named(actions[0], layout)}), so there is "
            "nothing to learn."
        )
    if asked == "class" or (asked == "auto" and few):
        order = np.argsort(-counts, kind="stable")
        classes = tuple(tuple(map(float, different[i])) for i in order)
        names = tuple(named(np.asarray(c), layout) for c in classes)
        return {"head": "class", "classes": classes, "class_names": names}
    low, high = _ranges(both, layout)
    high = np.where(high > low, high, low + 1.0)  # For a constant value.
    return {"low": tuple(map(float, low)), "high": tuple(map(float, high))}


def named(action: NDArray[np.floating], layout: Layout) -> str:
    """Return the name of an action: the keys that are held, or its values.

    Args:
        action: Shape (m,).
        layout: Meaning of the values.
    """
    parts = [name.split("/")[-1] for name in layout.names]
    if len(parts) != len(action):
        return " ".join(f"{value:g}" for value in action)
    is_keys = "forward" in parts and "left" in parts and set(action.tolist()) <= {0.0, 1.0}
    if is_keys:
        held = [part for part, value in zip(parts, action, strict=True) if value]
        return "+".join(held) or "none"
    return ", ".join(f"{part} {value:g}" for part, value in zip(parts, action, strict=True))


class Bin(msgspec.Struct, frozen=True):
    """Steps with similar confidence.

    Attributes:
        confidence: Mean probability of the chosen class.
        accuracy: Share of steps with the driver's class.
        steps: Number of steps.
    """

    confidence: float
    accuracy: float
    steps: int


class EvaluationResult(msgspec.Struct, frozen=True, kw_only=True):
    """Evaluation of a policy.

    Attributes:
        head: Kind of output.
        steps: Number of steps.
        accuracy: Share of steps with the driver's class. For continuous actions, the share in which
            all values are in the same third of their range as the driver's, such as left, straight
            and right. The range is the layout's, or where that has no bound the driver's.
        macro_f1: Mean F1 score over all classes that the driver or the policy chose; for continuous
            actions over the driver's.
        majority_baseline: Accuracy of always choosing the driver's most frequent class here.
        classes: Names of the classes, or of the thirds that occur.
        confusion: Number of steps by the driver's class (rows) and the policy's (columns).
        calibration: Steps grouped by confidence; () for continuous actions.
        ece: Expected calibration error: mean difference of confidence and accuracy, weighted by
            steps; None for continuous actions.
        numbers: Names of the values of an action.
        errors: Mean absolute error of each value, in its unit.
        within: Share of steps with every value within the tolerance.
        tolerance: Maximum error of such a value, as a share of half its range.
        worst: Indices of the steps with the largest errors, worst first.
        predicted: Actions of the policy at some steps, in time; () for classes.
        target: Actions of the driver at the same steps.
    """

    head: Head
    steps: int
    accuracy: float
    macro_f1: float
    majority_baseline: float
    classes: tuple[str, ...]
    confusion: tuple[tuple[int, ...], ...]
    calibration: tuple[Bin, ...]
    ece: float | None
    numbers: tuple[str, ...]
    errors: tuple[float, ...]
    within: float
    tolerance: float
    worst: tuple[int, ...]
    predicted: tuple[tuple[float, ...], ...]
    target: tuple[tuple[float, ...], ...]


def evaluate(
    policy: CameraPolicy, data: Dataset, which: NDArray[np.bool_] | None = None
) -> EvaluationResult:
    """Compare a policy with the driver of demonstrations.

    Args:
        policy: The policy.
        data: The demonstrations.
        which: Mask of the steps to use, shape (n,); None for all.

    Raises:
        PolicyError: If the layouts differ.
        CloningError: If there is no step, or the data lack an input of the policy.
    """
    policy.card.require_layouts(data.action_layout, data.state_layout)
    chosen = np.flatnonzero(np.ones(len(data), np.bool_) if which is None else which)
    if not len(chosen):
        raise CloningError("There is no step to evaluate the policy on.")
    pictures = None if data.pictures is None else data.pictures[chosen]
    states = None if data.states is None else data.states[chosen]
    target = data.actions[chosen].astype(np.float64)
    out = policy.outputs(pictures, states)
    predicted = policy.predict_many(pictures, states).astype(np.float64)
    layout = data.action_layout
    apart = np.abs(predicted - target)
    # From the driver alone: an absurd output would widen the range, and make all others seem right.
    low, high = _ranges(target, layout)
    half = 0.5 * (high - low)
    relative = apart / np.where(half > 0.0, half, 1.0)
    absurd: NDArray[np.bool_] | None = None
    calibration: tuple[Bin, ...] = ()
    ece: float | None = None
    if policy.card.classes:
        did, truth = out.argmax(axis=1), class_numbers(target, policy.card.classes)
        names = list(policy.card.class_names)
        for step in np.flatnonzero(truth < 0):  # Actions that are unknown to the policy.
            name = named(target[step], layout)
            if name not in names:
                names.append(name)
            truth[step] = names.index(name)
        calibration, ece = _calibration(out, did == truth)
        # The probability of an unknown action is 0.
        known = np.where(truth < out.shape[1], truth, 0)
        given = np.where(truth < out.shape[1], out[np.arange(len(out)), known], 0.0)
        wrongness = 1.0 - given + (did != truth)
    else:
        both = np.concatenate((np.clip(target, low, high), predicted))
        names, numbers = tercile_classes(both, layout, target)
        truth, did = numbers[: len(target)], numbers[len(target) :]
        absurd = did == (names.index(OUT_OF_RANGE) if OUT_OF_RANGE in names else -1)
        wrongness = relative.max(axis=1)
    confusion = np.zeros((len(names), len(names)), np.int64)
    np.add.at(confusion, (truth, did), 1)
    # Evenly spaced steps, in order.
    points = 0 if policy.card.classes else min(len(target), _MAX_POINTS)
    shown = np.unique(np.linspace(0, len(target) - 1, points).round().astype(np.int64))
    return EvaluationResult(
        head=policy.card.head,
        steps=len(target),
        accuracy=float((truth == did).mean()),
        macro_f1=macro_f1(did, truth, absurd),
        majority_baseline=float(confusion.sum(axis=1).max() / len(target)),
        classes=tuple(names),
        confusion=tuple(tuple(map(int, row)) for row in confusion),
        calibration=calibration,
        ece=ece,
        numbers=layout.names,
        errors=tuple(map(float, apart.mean(axis=0))),
        within=float((relative <= _TOLERANCE).all(axis=1).mean()),
        tolerance=_TOLERANCE,
        worst=tuple(map(int, chosen[np.argsort(-wrongness, kind="stable")[:_WORST]])),
        predicted=tuple(tuple(map(float, row)) for row in predicted[shown]),
        target=tuple(tuple(map(float, row)) for row in target[shown]),
    )


def macro_f1(
    predicted: NDArray[np.int64], truth: NDArray[np.int64], absurd: NDArray[np.bool_] | None = None
) -> float:
    """Return the mean F1 score over every class that occurs in either array.

    Args:
        predicted: Chosen classes, shape (n,).
        truth: Correct classes, shape (n,).
        absurd: Mask of outputs that belong to no class, shape (n,). Each counts as a wrong choice
            of every class, and only classes of `truth` count: the score would otherwise improve
            when a wrong choice becomes an absurd one. None if each output is a class.
    """
    scores: list[float] = []
    for one in np.union1d(predicted, truth) if absurd is None else np.unique(truth):
        hits = float(((predicted == one) & (truth == one)).sum())
        chosen = predicted == one if absurd is None else (predicted == one) | absurd
        scores.append(2.0 * hits / float(chosen.sum() + (truth == one).sum()))
    return float(np.mean(scores))


def _calibration(
    out: NDArray[np.float32], right: NDArray[np.bool_]
) -> tuple[tuple[Bin, ...], float]:
    """Return the non-empty bins, and the expected calibration error."""
    sure = out.max(axis=1)
    places = np.minimum((sure * _BINS).astype(np.int64), _BINS - 1)
    bins = tuple(
        Bin(float(sure[inside].mean()), float(right[inside].mean()), int(inside.sum()))
        for inside in (places == place for place in range(_BINS))
        if inside.any()
    )
    return bins, sum(b.steps * abs(b.confidence - b.accuracy) for b in bins) / len(out)


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

    def __str__(self) -> str:
        rate = f"{self.per_100_m:.1f}"
        if not self.by_seed:
            return rate
        return f"{rate} ({max(self.by_seed):.1f} for the worst of {len(self.by_seed)} seeds)"


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


def outlook(card: CloneCard) -> Outlook | None:
    """Return the collisions to expect of a cloned driver, from its card.

    Returns:
        None if the policy does not steer by images, or its card has no `learned_s`. The rates are
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
        return f"more than {more[0]} collisions"
    if not more:
        return f"about {less[-1]} collisions or fewer"
    return f"{more[0].per_100_m:.1f} to {less[-1]} collisions"


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
