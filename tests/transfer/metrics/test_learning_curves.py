"""Learning curves: validation, interpolation, and areas by hand."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable

import numpy as np
import pytest

from shapechanger.errors import StudyError
from shapechanger.transfer.metrics import LearningCurves, in_total_steps
from shapechanger.transfer.metrics.curves import check_comparable

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
        ([0.0, 1.0], [["high", "low"]], "array of numbers"),
        ([0.0, 1.0], [[1.0], [1.0, 2.0]], "array of numbers"),
    ],
)
def test_bad_curves_are_refused(steps: object, returns: object, message: str) -> None:
    with pytest.raises(StudyError, match=message):
        LearningCurves(steps, returns)  # type: ignore[arg-type]


@pytest.mark.parametrize("source_steps", [-1.0, np.nan, np.inf])
def test_source_steps_must_be_a_count(source_steps: float) -> None:
    with pytest.raises(StudyError, match="source_steps"):
        in_total_steps(RISING, source_steps, 0.0)


@pytest.mark.parametrize("floor", [np.nan, -np.inf])
def test_floor_must_be_finite(floor: float) -> None:
    with pytest.raises(StudyError, match="floor"):
        in_total_steps(RISING, 10, floor)


def test_curves_are_copies() -> None:
    """Later changes of the given arrays have no effect."""
    steps, returns = np.array([0.0, 1.0]), np.array([[1.0, 2.0]])
    curves = LearningCurves(steps, returns)
    steps[1], returns[0, 0] = 9.0, 9.0
    np.testing.assert_array_equal(curves.steps, [0.0, 1.0])
    np.testing.assert_array_equal(curves.returns, [[1.0, 2.0]])


@pytest.mark.parametrize(
    "copied_from",
    [
        lambda curves: curves,
        copy.deepcopy,
        lambda curves: pickle.loads(pickle.dumps(curves)),
        lambda curves: in_total_steps(curves, 1, 0.5),
    ],
    ids=["built", "copied", "pickled", "counted"],
)
def test_curves_cannot_be_written_to(
    copied_from: Callable[[LearningCurves], LearningCurves],
) -> None:
    """Fields and arrays are read-only, also in copies and pickles."""
    built = in_total_steps(RISING, 1, 0.5)
    again = copy.deepcopy(built)
    assert (again.source_steps, again.floor) == (1.0, 0.5)
    copied = copied_from(RISING)
    with pytest.raises(ValueError, match="read-only"):
        copied.returns[0, 0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        copied.steps[0] = 1.0
    with pytest.raises(AttributeError):
        copied.floor = 1.0  # type: ignore[misc]
    np.testing.assert_array_equal(copied.returns, RISING.returns)


def test_curves_are_straight_between_evaluations_and_hold_their_end() -> None:
    """Values are linear between evaluations and constant after the last."""
    np.testing.assert_allclose(RISING.at([25.0, 100.0, 400.0]), [[0.25, 1, 1], [0.75, 0, 0]])
    np.testing.assert_allclose(RISING.at(25.0), [[0.25], [0.75]])


def test_area_weighs_uneven_evaluations() -> None:
    """Trapezoids: (0 + 4)/2 · 10 + (4 + 2)/2 · 30 = 110, over 40."""
    curves = LearningCurves(np.array([0.0, 10.0, 40.0]), np.array([[0.0, 4.0, 2.0]]))
    np.testing.assert_allclose(curves.auc(), [2.75])


def test_one_evaluation_spans_no_area() -> None:
    with pytest.raises(StudyError, match="no area"):
        LearningCurves(np.array([0.0]), np.array([[1.0]])).auc()


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
        # Almost no target steps are left: nearly the value of the first evaluation.
        (99, (-99 + 0.005) / 100, (-99 + 0.995) / 100),
        # No target steps are left.
        (100, -1.0, -1.0),
        (1000, -1.0, -1.0),
    ],
)
def test_area_in_total_steps_is_exact(source_steps: int, rising: float, falling: float) -> None:
    total = in_total_steps(RISING, source_steps, floor=-1.0)
    np.testing.assert_allclose(total.auc(), [rising, falling], rtol=1e-12)


def test_source_steps_count_once() -> None:
    with pytest.raises(StudyError, match="already count 30"):
        in_total_steps(in_total_steps(RISING, 30, 0.0), 30, 0.0)


def test_scratch_has_no_source() -> None:
    with pytest.raises(StudyError, match="cannot count source steps"):
        check_comparable(RISING, in_total_steps(RISING, 30, 0.0))
