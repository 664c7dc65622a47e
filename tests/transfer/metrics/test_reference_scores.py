"""Scores: the reference, undefined scores, and clipping."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shapechanger.errors import StudyError
from shapechanger.transfer.metrics import LearningCurves, Reference, in_total_steps

STEPS = np.array([0.0, 10.0, 20.0])
SCRATCH = LearningCurves(STEPS, np.array([[-100.0, 200.0, 300.0], [-100.0, 400.0, 300.0]]))


def test_scores_run_from_zero_to_one() -> None:
    """0 takes no skill and 1 is the end of the best arm; a better run is above 1."""
    reference = Reference(zero=-100.0, one=300.0)
    scores = reference.scores(LearningCurves(STEPS, np.array([[-200.0, 100.0, 500.0]])))
    np.testing.assert_allclose(scores.returns, [[-0.25, 0.5, 1.5]])
    np.testing.assert_array_equal(scores.steps, STEPS)
    clipped = reference.scores(LearningCurves(STEPS, np.array([[-200.0, 100.0, 500.0]])), clip=True)
    np.testing.assert_allclose(clipped.returns, [[0.0, 0.5, 1.0]])


def test_a_shipped_reference_overrides_the_best_arm() -> None:
    """A shipped reference is 1 in every study, so a better arm scores above 1."""
    floors, ends = {"random actions": -100.0}, {"scratch": 100.0, "fine-tune": 500.0}
    of_arms = Reference.of(floors, ends)
    assert (of_arms.one, of_arms.one_of, of_arms.shipped) == (500.0, "fine-tune", False)
    shipped = Reference.of(floors, ends, ("the reference", 300.0))
    assert (shipped.one, shipped.one_of, shipped.shipped) == (300.0, "the reference", True)
    scores = shipped.scores(LearningCurves(STEPS, np.array([[-100.0, 300.0, 500.0]])))
    np.testing.assert_allclose(scores.returns, [[0.0, 1.0, 1.5]])


def test_the_floor_is_scored_too() -> None:
    """Counting source steps and scoring commute."""
    reference = Reference(zero=-100.0, one=300.0)
    first_counted = reference.scores(in_total_steps(SCRATCH, 7, reference.zero))
    first_scored = in_total_steps(reference.scores(SCRATCH), 7, 0.0)
    assert first_counted.floor == first_scored.floor == 0.0
    np.testing.assert_array_equal(first_counted.auc(), first_scored.auc())


def test_a_reference_is_the_best_floor_and_the_best_end() -> None:
    floors = {"random actions": -10.0, "the zero action": 997.0, "untrained policies": 994.0}
    reference = Reference.of(floors, {"scratch": 1100.0, "fine-tune": 1500.0})
    assert reference == Reference(997.0, 1500.0, "the zero action", "fine-tune")


def test_a_reference_needs_both_ends() -> None:
    with pytest.raises(StudyError, match="needs a floor"):
        Reference.of({}, {"scratch": 1.0})
    with pytest.raises(StudyError, match="needs a floor"):
        Reference.of({"random actions": 1.0}, {})


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_reference_is_finite(bad: float) -> None:
    with pytest.raises(StudyError, match="finite"):
        Reference(zero=bad, one=1.0)
    with pytest.raises(StudyError, match="finite"):
        Reference(zero=0.0, one=bad)


@pytest.mark.parametrize(
    ("zero", "one", "defined"),
    [
        (0.0, 1.0, True),
        (5.0, 5.0, False),
        (5.0, 4.0, False),
        (1e6, 1e6 + 1e-6, False),
        (-1e6, 1e6, True),
    ],
)
def test_scores_exist_only_if_an_arm_learned(zero: float, one: float, defined: bool) -> None:
    """Scores are undefined unless an arm ended above zero, beyond rounding."""
    reference = Reference(zero, one)
    assert reference.defined is defined
    if not defined:
        with pytest.raises(StudyError, match="no arm learned"):
            reference.scores(SCRATCH)
