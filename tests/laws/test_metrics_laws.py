"""Laws of the transfer metrics, for any curves."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from shapechanger.transfer.metrics.curves import LearningCurves, Reference, in_total_steps
from shapechanger.transfer.metrics.intervals import Estimate
from shapechanger.transfer.metrics.measures import (
    Summary,
    asymptotic_gain,
    auc_ratio,
    forward_transfer,
    jumpstart,
    steps_to_reach,
    summarise,
    time_to_threshold,
    total_reward_gain,
)

Pair = tuple[LearningCurves, LearningCurves]
Difference = Callable[[LearningCurves, LearningCurves], Estimate]

DIFFERENCES: dict[str, Difference] = {
    "jumpstart": jumpstart,
    "asymptotic gain": lambda arm, scratch: asymptotic_gain(arm, scratch, last_k=1),
    "total reward gain": total_reward_gain,
    "steps saved": lambda arm, scratch: time_to_threshold(arm, scratch, 0.5).steps_saved,
}
differences = pytest.mark.parametrize("difference", DIFFERENCES.values(), ids=DIFFERENCES.keys())

law = settings(max_examples=40)

# Returns of a few units, and of up to 10,000, as for simulated robots.
heights = st.floats(-5.0, 5.0) | st.floats(-1e4, 1e4)
source_steps = st.just(0) | st.integers(0, 2000)


@st.composite
def pairs(draw: st.DrawFn, low: float | None = None, high: float | None = None) -> Pair:
    gaps = draw(st.lists(st.integers(1, 300), min_size=1, max_size=5))
    steps = np.cumsum([0.0, *gaps])
    heights_here = heights if low is None else st.floats(low, high)

    def curves() -> LearningCurves:
        row = st.lists(heights_here, min_size=steps.size, max_size=steps.size)
        return LearningCurves(steps, np.array(draw(st.lists(row, min_size=1, max_size=4))))

    return curves(), curves()


def value(estimate: Estimate) -> float:
    assert estimate.value is not None
    return estimate.value


def summary_of(
    arm: LearningCurves, scratch: LearningCurves, reference: Reference, source: float
) -> Summary:
    return summarise(
        scratch, arm, reference, source_steps=source, rng=np.random.default_rng(0), last_k=1
    )


@differences
@law
@given(pair=pairs())
def test_differences_are_antisymmetric(difference: Difference, pair: Pair) -> None:
    """Swapping the arms negates estimates and intervals; no arm gains on itself."""
    arm, scratch = pair
    assert value(difference(arm, arm)) == 0.0
    there, back = difference(arm, scratch), difference(scratch, arm)
    assert value(there) == -value(back)
    if there.low is None:
        assert back.low is None
    else:
        np.testing.assert_allclose([there.low, there.high], [-back.high, -back.low], rtol=1e-9)


@law
@given(pair=pairs(0.0, 1.0))
def test_ratios_of_an_arm_with_itself(pair: Pair) -> None:
    """Identity: a ratio of 1 and a forward transfer of 0, where defined."""
    arm, _ = pair
    ratio = auc_ratio(arm, arm, rng=np.random.default_rng(0))
    transfer = forward_transfer(arm, arm, rng=np.random.default_rng(0))
    assert ratio.value in (None, 1.0)
    assert transfer.value in (None, 0.0)


@law
@given(
    pair=pairs(),
    scale=st.floats(1e-2, 1e2),
    offset=st.floats(-1e3, 1e3),
    span=st.floats(1.0, 1e3),
    clip=st.booleans(),
)
def test_scores_are_invariant_to_reward_units(
    pair: Pair, scale: float, offset: float, span: float, clip: bool
) -> None:
    """Affine invariance: scaling and shifting the reward does not change scores."""
    curves, _ = pair
    plain = Reference(0.0, span)
    moved = Reference(offset, scale * span + offset)
    rewarded = LearningCurves(curves.steps, scale * curves.returns + offset)
    np.testing.assert_allclose(
        moved.scores(rewarded, clip=clip).returns,
        plain.scores(curves, clip=clip).returns,
        rtol=1e-6,
        atol=1e-6,
    )


@differences
@law
@given(pair=pairs(), bonus=st.floats(0.0, 100.0), source=source_steps)
def test_a_better_arm_never_gains_less(
    difference: Difference, pair: Pair, bonus: float, source: int
) -> None:
    """Monotonicity: a bonus at every evaluation lowers no gain, with or without source steps."""
    arm, scratch = pair
    better = LearningCurves(arm.steps, arm.returns + bonus)
    before = value(difference(in_total_steps(arm, source, 0.0), scratch))
    after = value(difference(in_total_steps(better, source, 0.0), scratch))
    assert after >= before - 1e-9 * max(1.0, abs(before))


@law
@given(pair=pairs(), threshold=heights, source=source_steps)
def test_restricted_times_stay_within_the_budget(pair: Pair, threshold: float, source: int) -> None:
    """Times are in [0, horizon]; others are censored. A higher threshold is never sooner."""
    arm, scratch = pair
    counted = in_total_steps(arm, source, -1e4)
    times = time_to_threshold(counted, scratch, threshold)
    for reached in (times.arm, times.scratch):
        assert reached is not None
        assert 0.0 <= reached.restricted_mean <= arm.horizon
        assert 0.0 <= reached.fraction <= 1.0
        assert (reached.restricted_median is None) == (reached.fraction < 0.5)
    steps: NDArray[np.float64] = steps_to_reach(counted, threshold)
    assert np.all((steps <= arm.horizon) | np.isinf(steps))
    assert np.all(steps <= steps_to_reach(counted, threshold + 0.5))


@law
@given(pair=pairs(), source=st.integers(0, 2000))
def test_source_steps_delay_crossings_in_total_steps(pair: Pair, source: int) -> None:
    curves, _ = pair
    floor = float(curves.returns.min()) - 1.0
    height = float(curves.returns.mean())
    alone = steps_to_reach(curves, height)
    counted = steps_to_reach(in_total_steps(curves, source, floor), height)
    np.testing.assert_array_equal(
        counted, np.where(alone + source <= curves.horizon, alone + source, np.inf)
    )


@law
@given(pair=pairs())
def test_without_source_steps_both_counts_agree(pair: Pair) -> None:
    """Estimates and intervals are exactly equal."""
    summary = summary_of(*pair, Reference(0.0, 1.0), 0)
    assert summary.in_total_steps == summary.in_target_steps
