"""Scores: the scale, its absence, and what clipping does."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest

from shapechanger.errors import StudyError
from shapechanger.transfer.metrics import LearningCurves, Reference, in_total_steps

STEPS = np.array([0.0, 10.0, 20.0])
SCRATCH = LearningCurves(STEPS, np.array([[-100.0, 200.0, 300.0], [-100.0, 400.0, 300.0]]))


def test_scores_run_from_random_to_final() -> None:
    """0 is the random policy, 1 is where scratch ends, and better than that is above 1."""
    reference = Reference(random=-100.0, final=300.0)
    scores = reference.scores(LearningCurves(STEPS, np.array([[-200.0, 100.0, 500.0]])))
    np.testing.assert_allclose(scores.returns, [[-0.25, 0.5, 1.5]])
    np.testing.assert_array_equal(scores.steps, STEPS)


def test_clipped_scores_stay_between_0_and_1() -> None:
    """Forward transfer takes 1 for the most that can be reached."""
    reference = Reference(random=-100.0, final=300.0)
    curves = LearningCurves(STEPS, np.array([[-200.0, 100.0, 500.0]]))
    np.testing.assert_allclose(reference.scores(curves, clip=True).returns, [[0.0, 0.5, 1.0]])


def test_the_floor_is_scored_too() -> None:
    """Counting source steps and taking scores may be done in either order."""
    reference = Reference(random=-100.0, final=300.0)
    first_counted = reference.scores(in_total_steps(SCRATCH, 7, reference.random))
    first_scored = in_total_steps(reference.scores(SCRATCH), 7, 0.0)
    assert first_counted.floor == first_scored.floor == 0.0
    np.testing.assert_array_equal(first_counted.auc(), first_scored.auc())


def test_reference_is_measured_on_the_target() -> None:
    """Random returns are averaged, and the last k evaluations over all seeds are."""
    assert Reference.of(SCRATCH, [-90.0, -110.0], last_k=1) == Reference(-100.0, 300.0)
    assert Reference.of(SCRATCH, [[-100.0]], last_k=2) == Reference(-100.0, 300.0)
    assert Reference.of(SCRATCH, -100.0, last_k=3) == Reference(-100.0, 1000.0 / 6.0)


def test_reference_needs_random_returns() -> None:
    """The mean of nothing is no reference."""
    with pytest.raises(StudyError, match="at least one return"):
        Reference.of(SCRATCH, [], last_k=1)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_reference_is_finite(bad: float) -> None:
    """A scale has two ends."""
    with pytest.raises(StudyError, match="finite"):
        Reference(random=bad, final=1.0)
    with pytest.raises(StudyError, match="finite"):
        Reference(random=0.0, final=bad)


@pytest.mark.parametrize(
    ("random", "final", "defined"),
    [
        (0.0, 1.0, True),
        (5.0, 5.0, False),
        (5.0, 4.0, False),
        (1e6, 1e6 + 1e-6, False),
        (-1e6, 1e6, True),
    ],
)
def test_scores_exist_only_if_scratch_learned(random: float, final: float, defined: bool) -> None:
    """Where scratch ends no better than random, up to rounding, the scale says that it is none."""
    reference = Reference(random, final)
    assert reference.defined is defined
    if not defined:
        with pytest.raises(StudyError, match="did not learn"):
            reference.scores(SCRATCH)


def test_reference_survives_json() -> None:
    """It is part of the report."""
    reference = Reference(-325.6, 5139.8)
    assert msgspec.json.decode(msgspec.json.encode(reference), type=Reference) == reference
