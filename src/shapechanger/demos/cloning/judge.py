"""How good a policy is on demonstrations that it did not learn from."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.cloning.card import Head
from shapechanger.demos.cloning.errors import CloningError
from shapechanger.demos.cloning.goal import class_numbers, named
from shapechanger.demos.cloning.policy import CameraPolicy
from shapechanger.demos.cloning.thirds import in_thirds

if TYPE_CHECKING:
    from shapechanger.demos.dataset import Dataset

__all__ = ["TOLERANCE", "Bin", "Judgement", "judge", "macro_f1"]

TOLERANCE: Final = 0.1
"""An action is within the tolerance if each of its numbers is wrong by no more than this share of
half its range."""

_BINS: Final = 10
_WORST: Final = 12
# More points than this make no picture clearer.
_MOST_POINTS: Final = 2000


class Bin(msgspec.Struct, frozen=True):
    """Steps on which the policy was about equally sure.

    Attributes:
        sure: Mean probability that it gave to what it did.
        right: Share of them on which it did what the driver did.
        steps: How many.
    """

    sure: float
    right: float
    steps: int


class Judgement(msgspec.Struct, frozen=True, kw_only=True):
    """How good a policy was.

    Attributes:
        head: What comes out of the policy.
        steps: Steps that it was judged on.
        accuracy: Share of steps on which it did what the driver did. Where it gives numbers: on
            which all of its numbers fall in the same third of their range as the driver's, such as
            left, straight and right.
        macro_f1: Mean over the classes of the harmonic mean of precision and recall; of every class
            that the driver or the policy chose.
        always: The accuracy of always doing what the driver did most, on these very steps.
        classes: What can be chosen, or the thirds that came up.
        confusion: Steps by what the driver did (rows) and the policy did (columns).
        calibration: Steps by how sure the policy was; () where it gives numbers.
        ece: Mean distance between how sure it was and how often it was right, weighted by steps
            (expected calibration error); None where it gives numbers.
        numbers: Names of the numbers of an action.
        errors: Mean absolute error of each number, in its own unit.
        within: Share of steps on which every number is within the tolerance.
        tolerance: What that is, see `TOLERANCE`.
        worst: Steps on which it was most wrong, worst first: surest of something else, or farthest.
        done: What the policy did on some steps, in time; () for classes.
        wanted: What the driver did on the same steps.
    """

    head: Head
    steps: int
    accuracy: float
    macro_f1: float
    always: float
    classes: tuple[str, ...]
    confusion: tuple[tuple[int, ...], ...]
    calibration: tuple[Bin, ...]
    ece: float | None
    numbers: tuple[str, ...]
    errors: tuple[float, ...]
    within: float
    tolerance: float
    worst: tuple[int, ...]
    done: tuple[tuple[float, ...], ...]
    wanted: tuple[tuple[float, ...], ...]


def judge(policy: CameraPolicy, data: Dataset, which: NDArray[np.bool_] | None = None) -> Judgement:
    """Let a policy do what a driver did, and compare.

    Args:
        policy: The policy.
        data: What the driver perceived and did.
        which: The steps to judge on, shape (n,); None for all.

    Raises:
        PolicyError: If the policy is for another layout.
        CloningError: If there is no step, or the policy perceives what the data do not have.
    """
    policy.card.require_layouts(data.action_layout, data.state_layout)
    chosen = np.flatnonzero(np.ones(len(data), np.bool_) if which is None else which)
    if not len(chosen):
        raise CloningError("There is no step to judge the policy on.")
    pictures = None if data.pictures is None else data.pictures[chosen]
    states = None if data.states is None else data.states[chosen]
    wanted = data.actions[chosen].astype(np.float64)
    out = policy.outputs(pictures, states)
    done = policy.predict_many(pictures, states).astype(np.float64)
    layout = data.action_layout
    apart = np.abs(done - wanted)
    half = 0.5 * (_bound(layout.high, wanted, done, 1.0) - _bound(layout.low, wanted, done, -1.0))
    relative = apart / np.where(half > 0.0, half, 1.0)
    calibration: tuple[Bin, ...] = ()
    ece: float | None = None
    if policy.card.classes:
        names = list(policy.card.class_names)
        did, truth = out.argmax(axis=1), class_numbers(wanted, policy.card.classes)
        names, truth = _with_others(names, truth, wanted, data)
        calibration, ece = _calibration(out, did == truth)
        # Of an action that it does not know it is as sure as can be of something else.
        known = np.where(truth < out.shape[1], truth, 0)
        given = np.where(truth < out.shape[1], out[np.arange(len(out)), known], 0.0)
        wrongness = 1.0 - given + (did != truth)
    else:
        both = np.concatenate((wanted, done))
        names, numbers = in_thirds(both, layout)
        truth, did = numbers[: len(wanted)], numbers[len(wanted) :]
        wrongness = relative.max(axis=1)
    confusion = np.zeros((len(names), len(names)), np.int64)
    np.add.at(confusion, (truth, did), 1)
    shown = _some(len(wanted)) if not policy.card.classes else np.zeros(0, np.int64)
    return Judgement(
        head=policy.card.head,
        steps=len(wanted),
        accuracy=float((truth == did).mean()),
        macro_f1=macro_f1(did, truth),
        always=float(confusion.sum(axis=1).max() / len(wanted)),
        classes=tuple(names),
        confusion=tuple(tuple(map(int, row)) for row in confusion),
        calibration=calibration,
        ece=ece,
        numbers=layout.names,
        errors=tuple(map(float, apart.mean(axis=0))),
        within=float((relative <= TOLERANCE).all(axis=1).mean()),
        tolerance=TOLERANCE,
        worst=tuple(map(int, chosen[np.argsort(-wrongness, kind="stable")[:_WORST]])),
        done=tuple(tuple(map(float, row)) for row in done[shown]),
        wanted=tuple(tuple(map(float, row)) for row in wanted[shown]),
    )


def macro_f1(done: NDArray[np.int64], truth: NDArray[np.int64]) -> float:
    """Mean F1 over every class that was chosen or would have been right, each counting the same.

    Args:
        done: Chosen classes, shape (n,).
        truth: Right classes, shape (n,).
    """
    scores: list[float] = []
    for one in np.union1d(done, truth):
        hits = float(((done == one) & (truth == one)).sum())
        scores.append(2.0 * hits / float((done == one).sum() + (truth == one).sum()))
    return float(np.mean(scores))


def _bound(
    bound: NDArray[np.float64],
    wanted: NDArray[np.float64],
    done: NDArray[np.float64],
    sign: float,
) -> NDArray[np.float64]:
    """The bound of a range, or the farthest number where the layout has none."""
    farthest = sign * np.maximum((sign * wanted).max(axis=0), (sign * done).max(axis=0))
    return np.where(np.isfinite(bound), bound, farthest)


def _with_others(
    names: list[str], truth: NDArray[np.int64], wanted: NDArray[np.float64], data: Dataset
) -> tuple[list[str], NDArray[np.int64]]:
    """Classes for what the driver did here and the policy was never shown."""
    names, truth = list(names), truth.copy()
    for step in np.flatnonzero(truth < 0):
        name = named(wanted[step], data.action_layout)
        if name not in names:
            names.append(name)
        truth[step] = names.index(name)
    return names, truth


def _calibration(
    out: NDArray[np.float32], right: NDArray[np.bool_]
) -> tuple[tuple[Bin, ...], float]:
    """The bins that hold anything, and the expected calibration error."""
    sure = out.max(axis=1)
    places = np.minimum((sure * _BINS).astype(np.int64), _BINS - 1)
    bins = tuple(
        Bin(float(sure[inside].mean()), float(right[inside].mean()), int(inside.sum()))
        for inside in (places == place for place in range(_BINS))
        if inside.any()
    )
    return bins, sum(b.steps * abs(b.sure - b.right) for b in bins) / len(out)


def _some(n: int) -> NDArray[np.int64]:
    """Some steps in order, evenly."""
    return np.unique(np.linspace(0, n - 1, min(n, _MOST_POINTS)).round().astype(np.int64))
