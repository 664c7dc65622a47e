"""Learning curves and scores: validation, interpolation, and hand-computed areas and references."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from shapechanger.errors import StudyError
from shapechanger.transfer.metrics.curves import (
    LearningCurves,
    Reference,
    check_comparable,
    in_total_steps,
)

NAN, INF = math.nan, math.inf
# Two seeds, three evaluations: one rises from 0 to 1, one falls from 1 to 0.
STEPS = np.array([0.0, 50.0, 100.0])
RISING = LearningCurves(STEPS, np.array([[0.0, 0.5, 1.0], [1.0, 0.5, 0.0]]))


@pytest.mark.parametrize(
    ("steps", "returns", "message"),
    [
        ([], np.zeros((1, 0)), "n_evals"),
        ([[0.0]], [[1.0]], "n_evals"),
        ([1.0, 2.0], [[1.0, 2.0]], "start at 0"),
        ([0.0, 2.0, 2.0], [[1.0, 2.0, 3.0]], "strictly increase"),
        ([0.0, 1.0], [1.0, 2.0], r"\(n_seeds, 2\)"),
        ([0.0, 1.0], np.zeros((0, 2)), r"\(n_seeds, 2\)"),
        ([0.0, 1.0], [[1.0, 2.0, 3.0]], r"\(n_seeds, 2\)"),
        ([0.0, 1.0], [[1.0, np.nan]], "returns must be finite"),
        ([0.0, 1.0], [[1.0, np.inf]], "returns must be finite"),
        ([0.0, 1.0], [[1.0, 1e300]], "returns must be finite"),
        ([0.0, np.inf], [[1.0, 2.0]], "steps must be finite"),
    ],
)
def test_bad_curves_are_refused(steps: object, returns: object, message: str) -> None:
    with pytest.raises(StudyError, match=message):
        LearningCurves(steps, returns)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("refused", "words"),
    [
        *((partial(in_total_steps, RISING, n, 0.0), "source_steps") for n in (-1, NAN, INF)),
        *((partial(in_total_steps, RISING, 1, floor), "floor") for floor in (NAN, -INF)),
        *((partial(Reference, *ends), "finite") for ends in ((NAN, 1.0), (0.0, NAN), (0.0, INF))),
        (LearningCurves(np.zeros(1), np.ones((1, 1))).auc, "no area"),
        (lambda: in_total_steps(in_total_steps(RISING, 30, 0.0), 30, 0.0), "already count 30"),
        (lambda: check_comparable(RISING, in_total_steps(RISING, 3, 0.0)), "cannot count source"),
    ],
)
def test_impossible_counts_are_refused(refused: Callable[[], object], words: str) -> None:
    """One evaluation spans no area, source steps count once, and scratch has no source."""
    with pytest.raises(StudyError, match=words):
        refused()


def test_curves_are_read_only_copies() -> None:
    """Later changes of the given arrays have no effect, and fields cannot be written to."""
    steps, returns = np.array([0.0, 1.0]), np.array([[1.0, 2.0]])
    curves = in_total_steps(LearningCurves(steps, returns), 1, 0.5)
    steps[1], returns[0, 0] = 9.0, 9.0
    np.testing.assert_array_equal(curves.steps, [0.0, 1.0])
    np.testing.assert_array_equal(curves.returns, [[1.0, 2.0]])
    assert (curves.source_steps, curves.floor) == (1.0, 0.5)
    for numbers in (curves.steps, curves.returns):
        with pytest.raises(ValueError, match="read-only"):
            numbers[0] = 1.0
    with pytest.raises(AttributeError):
        curves.floor = 1.0  # type: ignore[misc]


def test_curves_are_straight_between_evaluations_and_hold_their_end() -> None:
    np.testing.assert_allclose(RISING.at([25.0, 100.0, 400.0]), [[0.25, 1, 1], [0.75, 0, 0]])
    np.testing.assert_allclose(RISING.at(25.0), [[0.25], [0.75]])
    # Areas are trapezoids: (0 + 4)/2 · 10 + (4 + 2)/2 · 30 = 110, divided by 40 steps.
    curves = LearningCurves(np.array([0.0, 10.0, 40.0]), np.array([[0.0, 4.0, 2.0]]))
    np.testing.assert_allclose(curves.auc(), [2.75])


def test_total_steps_jump_without_a_slope() -> None:
    """The floor holds until the last source step; the first evaluation follows at once."""
    total = in_total_steps(RISING, 30, floor=-2.0)
    just_before = np.nextafter(30.0, 0.0)
    np.testing.assert_allclose(
        total.at([0.0, just_before, 30.0, 55.0, 100.0]),
        [[-2.0, -2.0, 0.0, 0.25, 0.7], [-2.0, -2.0, 1.0, 0.75, 0.3]],
    )


@pytest.mark.parametrize(
    ("source_steps", "rising", "falling"),
    [
        # Target steps only.
        (0, 0.5, 0.5),
        # Between evaluations: floor -1 · 30, then 70 steps of the curve.
        (30, (-30 + 0.35 * 70) / 100, (-30 + 0.65 * 70) / 100),
        # On an evaluation: floor -1 · 50, then the first half of the curve.
        (50, (-50 + 0.25 * 50) / 100, (-50 + 0.75 * 50) / 100),
        # One target step is left: floor -1 · 99, then the first step of the curve.
        (99, (-99 + 0.005) / 100, (-99 + 0.995) / 100),
        # No target steps are left.
        (100, -1.0, -1.0),
        (1000, -1.0, -1.0),
    ],
)
def test_area_in_total_steps_is_exact(source_steps: int, rising: float, falling: float) -> None:
    total = in_total_steps(RISING, source_steps, floor=-1.0)
    np.testing.assert_allclose(total.auc(), [rising, falling], rtol=1e-12)


FEW = np.array([0.0, 10.0, 20.0])
SCRATCH = LearningCurves(FEW, np.array([[-100.0, 200.0, 300.0], [-100.0, 400.0, 300.0]]))


def test_scores_run_from_zero_to_one() -> None:
    """A score of 0 is `zero` and 1 is `one`; scores outside of this range may be clipped."""
    reference = Reference(zero=-100.0, one=300.0)
    scores = reference.scores(LearningCurves(FEW, np.array([[-200.0, 100.0, 500.0]])))
    np.testing.assert_allclose(scores.returns, [[-0.25, 0.5, 1.5]])
    np.testing.assert_array_equal(scores.steps, FEW)
    clipped = reference.scores(LearningCurves(FEW, np.array([[-200.0, 100.0, 500.0]])), clip=True)
    np.testing.assert_allclose(clipped.returns, [[0.0, 0.5, 1.0]])


def test_a_shipped_reference_overrides_the_best_arm() -> None:
    """Zero is the best floor. A shipped one is 1 in every study: a better arm scores above 1."""
    floors = {"random actions": -200.0, "the zero action": -100.0, "untrained policies": -150.0}
    ends = {"scratch": 100.0, "fine-tune": 500.0}
    assert Reference.of(floors, ends) == Reference(-100.0, 500.0, "the zero action", "fine-tune")
    assert not Reference.of(floors, ends).shipped
    shipped = Reference.of(floors, ends, ("the reference", 300.0))
    assert (shipped.one, shipped.one_of, shipped.shipped) == (300.0, "the reference", True)
    scores = shipped.scores(LearningCurves(FEW, np.array([[-100.0, 300.0, 500.0]])))
    np.testing.assert_allclose(scores.returns, [[0.0, 1.0, 1.5]])


def test_the_floor_is_scored_too() -> None:
    """Scoring and counting source steps can be done in either order."""
    reference = Reference(zero=-100.0, one=300.0)
    first_counted = reference.scores(in_total_steps(SCRATCH, 7, reference.zero))
    first_scored = in_total_steps(reference.scores(SCRATCH), 7, 0.0)
    assert first_counted.floor == first_scored.floor == 0.0
    np.testing.assert_array_equal(first_counted.auc(), first_scored.auc())


@pytest.mark.parametrize(
    ("zero", "one", "defined"),
    [(0.0, 1.0, True), (5.0, 5.0, False), (5.0, 4.0, False), (1e6, 1e6 + 1e-6, False)],
)
def test_scores_exist_only_if_one_is_above_zero(zero: float, one: float, defined: bool) -> None:
    """Scores are undefined unless `one` is above `zero` by more than rounding."""
    reference = Reference(zero, one)
    assert reference.defined is defined
    if not defined:
        with pytest.raises(StudyError, match="no arm learned"):
            reference.scores(SCRATCH)
