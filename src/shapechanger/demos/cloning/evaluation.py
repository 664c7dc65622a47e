"""Choose a clone's output encoding from the demonstrated actions, and evaluate a clone."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.cloning.clone import Clone, class_numbers
from shapechanger.errors import DemosError
from shapechanger.layout import Layout

if TYPE_CHECKING:
    from shapechanger.demos.dataset import Dataset

AskedHead = Literal["auto", "class", "regression"]
"""Requested kind of output; "auto" uses classes if few different actions were demonstrated."""

_MOST_CLASSES: Final = 16  # Actions are continuous if there are more different ones.
_MIN_REPEATS: Final = 4  # Average number of occurrences of each action for classes.
_TOLERANCE: Final = 0.1  # Largest error of a value, as a share of half its range.
_BINS: Final = 10
_WORST: Final = 12
_MAX_POINTS: Final = 2000  # Largest number of actions in a chart.
_WORDS: Final = {
    "steering": ("left", "straight", "right"),
    "throttle": ("back", "still", "forward"),
}
_PLACES: Final = ("low", "middle", "high")
OUT_OF_RANGE: Final = "out of range"


def tercile_classes(
    actions: NDArray[np.float64], layout: Layout, driver: NDArray[np.float64]
) -> tuple[list[str], NDArray[np.int64]]:
    """Classify actions by the third of its range that each value is in.

    Each combination of thirds that occurs is a class. The extremes of the driver's actions replace
    missing bounds. An action with a value outside its range by more than the tolerance is in the
    class `OUT_OF_RANGE`. Return the names of the classes, and each action's class index, (n,).
    """
    low, high = _ranges(driver, layout)
    share = (actions - low) / np.where(high > low, high - low, 1.0)
    third = (share > 1.0 / 3.0).astype(np.int64) + (share > 2.0 / 3.0)
    third[~(np.abs(share - 0.5) <= 0.5 * (1.0 + _TOLERANCE)).all(axis=1)] = -1
    found, numbers = np.unique(third, axis=0, return_inverse=True)
    parts = [name for feature in layout for name in [feature.name] * feature.size]

    def word(name: str, place: int) -> str:
        names = _WORDS.get(name.split("/")[-1])
        return names[place] if names else f"{name} {_PLACES[place]}"

    names = [
        OUT_OF_RANGE if row[0] < 0 else " ".join(map(word, parts, row.tolist())) for row in found
    ]
    return names, numbers.reshape(-1).astype(np.int64)


def _ranges(
    actions: NDArray[np.floating], layout: Layout
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the bounds of each value; the extreme action replaces a missing bound."""
    low = np.where(np.isfinite(layout.low), layout.low, actions.min(axis=0))
    return low, np.where(np.isfinite(layout.high), layout.high, actions.max(axis=0))


def output_fields(
    actions: NDArray[np.float32],
    layout: Layout,
    asked: AskedHead,
    mirrored: NDArray[np.float32] | None = None,
) -> dict[str, Any]:
    """Choose the output encoding from the demonstrated actions, as fields of a `CloneNetwork`.

    Actions, and their mirror images if images are mirrored, have the shape (n, m).
    """
    both = actions if mirrored is None else np.concatenate((actions, mirrored))
    different, counts = np.unique(both, axis=0, return_counts=True)
    if asked == "class" and len(different) > _MOST_CLASSES:
        raise DemosError(
            f"There are {len(different)} different actions, but at most {_MOST_CLASSES} classes "
            "are supported: choose the head regression."
        )
    if (actions == actions[0]).all() and asked != "regression":
        raise DemosError(
            f"All of {len(actions)} actions are equal ({named(actions[0], layout)}), so there is "
            "nothing to learn."
        )
    few = len(different) <= _MOST_CLASSES and _MIN_REPEATS * len(different) <= len(actions)
    if asked == "class" or (asked == "auto" and few):
        order = np.argsort(-counts, kind="stable")
        classes = [tuple(map(float, action)) for action in different[order]]
        return {
            "classes": tuple(classes),
            "class_names": tuple(named(np.asarray(each), layout) for each in classes),
        }
    low, high = _ranges(both, layout)
    high = np.where(high > low, high, low + 1.0)  # Avoids an empty range of a constant value.
    return {"low": tuple(low.tolist()), "high": tuple(high.tolist())}


def named(action: NDArray[np.floating], layout: Layout) -> str:
    """Return the name of an action, shape (m,): the keys that are held, or its values."""
    parts = [name.split("/")[-1] for name in layout.names]
    if len(parts) != len(action):
        return " ".join(f"{value:g}" for value in action)
    if {"forward", "left"} <= set(parts) and set(action.tolist()) <= {0.0, 1.0}:
        return "+".join(part for part, value in zip(parts, action, strict=True) if value) or "none"
    return ", ".join(f"{part} {value:g}" for part, value in zip(parts, action, strict=True))


class Bin(msgspec.Struct, frozen=True):
    """Mean confidence, accuracy and number of the steps with similar confidence."""

    confidence: float
    accuracy: float
    steps: int


class EvaluationResult(msgspec.Struct, frozen=True, kw_only=True):
    """Evaluation of a policy.

    Attributes:
        accuracy: Share of steps with the driver's class. For continuous actions, the share in which
            all values are in the same third of their range as the driver's, such as left, straight
            and right. The range is the layout's; the driver's extremes replace missing bounds.
        macro_f1: Mean F1 score over all classes that the driver or the policy chose; for continuous
            actions over the driver's classes only.
        majority_baseline: Accuracy of always choosing the driver's most frequent class here.
        classes: Names of the classes, or of the thirds that occur.
        confusion: Number of steps for each class of the driver (rows) and the policy (columns).
        calibration: Steps grouped by confidence; () for continuous actions.
        ece: Expected calibration error: mean difference of confidence and accuracy, weighted by
            steps; None for continuous actions.
        errors: Mean absolute error of each value, in its unit.
        within: Share of steps with every value within the tolerance.
        tolerance: The tolerance of a value, as a share of half its range.
        worst: Indices of the steps with the largest errors, worst first.
        predicted: Actions of the policy at some steps, in order of time; () for classes.
        target: Actions of the driver at the same steps.
    """

    head: Literal["class", "regression"]
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


def evaluate(policy: Clone, data: Dataset) -> EvaluationResult:
    """Compare a policy with the driver of demonstrations of the same layouts."""
    policy.card.require_layouts(data.action_layout, data.state_layout)
    if not len(data):
        raise DemosError("There is no step to evaluate the policy on.")
    target = data.actions.astype(np.float64)
    out = policy.outputs(data.pictures, data.states)
    predicted = policy.predict_many(data.pictures, data.states).astype(np.float64)
    layout, classes = data.action_layout, policy.net.classes
    apart = np.abs(predicted - target)
    # Ranges ignore the policy's outputs: an absurd output would make all others seem right.
    low, high = _ranges(target, layout)
    relative = apart / np.where(high > low, 0.5 * (high - low), 1.0)
    absurd, calibration, ece = None, (), None
    if classes:
        did, truth = out.argmax(axis=1), class_numbers(target, classes)
        names = list(policy.net.class_names)
        # The probability of an unknown action is 0.
        given = np.where(truth < 0, 0.0, out[np.arange(len(out)), truth])
        for step in np.flatnonzero(truth < 0):
            name = named(target[step], layout)
            names += [] if name in names else [name]
            truth[step] = names.index(name)
        calibration, ece = _calibration(out, did == truth)
        wrongness = 1.0 - given + (did != truth)
    else:
        both = np.concatenate((np.clip(target, low, high), predicted))
        names, numbers = tercile_classes(both, layout, target)
        truth, did = np.split(numbers, 2)
        absurd = did == (names.index(OUT_OF_RANGE) if OUT_OF_RANGE in names else -1)
        wrongness = relative.max(axis=1)
    confusion = np.zeros((len(names), len(names)), np.int64)
    np.add.at(confusion, (truth, did), 1)
    points = 0 if classes else min(len(target), _MAX_POINTS)
    shown = np.unique(np.linspace(0, len(target) - 1, points).round().astype(np.int64))
    return EvaluationResult(
        head="class" if classes else "regression",
        steps=len(target),
        accuracy=float((truth == did).mean()),
        macro_f1=macro_f1(did, truth, absurd),
        majority_baseline=float(confusion.sum(axis=1).max() / len(target)),
        classes=tuple(names),
        confusion=tuple(map(tuple, confusion.tolist())),
        calibration=calibration,
        ece=ece,
        numbers=layout.names,
        errors=tuple(apart.mean(axis=0).tolist()),
        within=float((relative <= _TOLERANCE).all(axis=1).mean()),
        tolerance=_TOLERANCE,
        worst=tuple(np.argsort(-wrongness, kind="stable")[:_WORST].tolist()),
        predicted=tuple(map(tuple, predicted[shown].tolist())),
        target=tuple(map(tuple, target[shown].tolist())),
    )


def macro_f1(
    predicted: NDArray[np.int64], truth: NDArray[np.int64], absurd: NDArray[np.bool_] | None = None
) -> float:
    """Return the mean F1 score over every class that occurs in either array of shape (n,).

    With a mask of outputs outside all classes, `absurd`, each of them counts as a wrong choice of
    every class, and only classes of `truth` count: otherwise the score would improve when a wrong
    choice becomes an absurd one.
    """
    scores: list[float] = []
    for one in np.union1d(predicted, truth) if absurd is None else np.unique(truth):
        chosen, true = predicted == one, truth == one
        taken = chosen if absurd is None else chosen | absurd
        scores.append(2.0 * float((chosen & true).sum()) / float(taken.sum() + true.sum()))
    return float(np.mean(scores))


def _calibration(
    out: NDArray[np.float32], correct: NDArray[np.bool_]
) -> tuple[tuple[Bin, ...], float]:
    """Return the non-empty bins, and the expected calibration error."""
    confidence = out.max(axis=1)
    places = np.minimum((confidence * _BINS).astype(np.int64), _BINS - 1)
    bins = tuple(
        Bin(float(confidence[inside].mean()), float(correct[inside].mean()), int(inside.sum()))
        for inside in (places == place for place in range(_BINS))
        if inside.any()
    )
    return bins, sum(b.steps * abs(b.confidence - b.accuracy) for b in bins) / len(out)
