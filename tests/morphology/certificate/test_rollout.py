"""Rollouts of two environments under the same commands."""

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np
import pytest

from shapechanger.layout import Feature, Layout
from shapechanger.morphology.certificate.certify import compare_rollouts, matched_commands
from tests.morphology.swing import Broken, Dictionary, Longer, Noisy, Swing


@pytest.mark.parametrize("wrapped", [lambda env: env, Dictionary, Broken])
@pytest.mark.parametrize("steps", [0, 20])
def test_equal_environments_have_equal_rollouts(wrapped: Any, steps: int) -> None:
    """Also one env twice, dictionaries in the order of their keys, and equal NaN."""
    env = wrapped(Swing())
    for target in (wrapped(Swing()), env):
        rollout = compare_rollouts(env, target, steps=steps)
        assert rollout.identical
        assert rollout.differs_by_rounding
        assert (rollout.steps, rollout.compared) == (steps, 2)
        assert str(rollout) == (
            f"{steps} steps from the same seed with the same commands: the 2 numbers that both "
            "observe are equal throughout."
        )


def test_the_first_difference_is_reported() -> None:
    rollout = compare_rollouts(Swing(), Swing(gear=2.0), steps=30)
    assert not rollout.identical
    assert rollout.first_step == 1
    assert rollout.first_feature == "hinge/velocity"
    assert rollout.largest_step is not None
    assert rollout.largest_difference > 0.0
    assert "part at step 1 in hinge/velocity" in str(rollout)
    assert "Rewards differ by up to" in str(rollout)


def test_the_largest_difference_is_correct() -> None:
    source, target = Swing(), Swing(length=0.8)
    rollout = compare_rollouts(source, target, steps=25, seed=3)
    commands, _ = matched_commands(source.action_layout, target.action_layout, 25, 3)
    seen = [
        np.stack([env.reset(seed=3)[0], *(env.step(command)[0] for command in commands)])
        for env in (source, target)
    ]
    gap = np.abs(seen[0] - seen[1])
    step, feature = np.unravel_index(np.argmax(gap), gap.shape)
    assert rollout.largest_difference == gap.max()
    assert rollout.largest_step == step
    assert rollout.largest_feature == source.observation_layout.names[feature]


def test_motors_of_the_same_name_get_the_same_commands() -> None:
    source, target = Swing(), Swing(wrist=True)
    compare_rollouts(source, target, steps=10)
    one, two = np.asarray(source.commands), np.asarray(target.commands)
    assert one.dtype == np.float32
    assert np.all(np.abs(one) <= 1.0)
    assert len(np.unique(one)) == 10
    np.testing.assert_array_equal(one[:, 0], two[:, 0])
    np.testing.assert_array_equal(two[:, 1], 0.0)
    compare_rollouts(source, target, steps=10, seed=1)
    assert not np.array_equal(one, np.asarray(source.commands))


def test_features_of_one_side_are_listed() -> None:
    rollout = compare_rollouts(Swing(), Swing(wrist=True), steps=5)
    assert rollout.compared == 2
    assert rollout.only_in_target == ("wrist/angle", "wrist/velocity")
    assert "Only the target observes 2 more, such as wrist/angle." in str(rollout)
    assert not rollout.identical


def test_the_shorter_episode_ends_the_comparison() -> None:
    rollout = compare_rollouts(Swing(), Swing(limit=7), steps=20)
    assert rollout.steps == 7
    assert (rollout.source_ended, rollout.target_ended) == (False, True)
    assert rollout.first_step is None
    assert not rollout.identical
    assert str(rollout).endswith("Only the target ended its episode.")
    assert compare_rollouts(Swing(limit=7), Swing(limit=7)).identical
    assert "source ended" in str(compare_rollouts(Swing(limit=3), Swing(limit=7)))


def test_rewards_and_wrappers_are_included() -> None:
    rollout = compare_rollouts(Swing(), Swing(bonus=1.0), steps=5)
    assert rollout.first_step is None
    assert rollout.reward_difference == pytest.approx(1.0)
    assert not rollout.identical
    rollout = compare_rollouts(Swing(), Noisy(Swing()), steps=5)
    assert rollout.first_step == 0
    assert "part at the reset" in str(rollout)
    # NaN on one side is the largest finite difference, which JSON can hold.
    rollout = compare_rollouts(Swing(), Broken(Swing()), steps=3)
    assert rollout.largest_difference == sys.float_info.max


def test_observations_without_a_layout_are_compared_by_index() -> None:
    rollout = compare_rollouts(Longer(Swing()), Longer(Swing(gear=2.0)), steps=5)
    assert rollout.compared == 3
    assert rollout.largest_feature == "observation[1]"
    uneven = compare_rollouts(Swing(), Longer(Swing()), steps=5)
    assert uneven.only_in_target == ("observation[2]",)


def test_without_common_features_rollouts_differ() -> None:
    """A block has a name per number."""
    target = Swing()
    target.observation_layout = Layout((Feature("block", "1", shape=(2, 1)),))
    rollout = compare_rollouts(Swing(), target, steps=5)
    assert (rollout.compared, rollout.only_in_target) == (0, ("block[0]", "block[1]"))
    assert not rollout.identical
    assert "Only the source observes 2 more" in str(rollout)


@pytest.mark.parametrize(
    ("bounds", "expected"),
    [
        ((-2.0, 3.0), (-2.0, 3.0)),
        ((-math.inf, math.inf), (-1.0, 1.0)),
        ((0.0, math.inf), (0.0, 1.0)),
        ((5.0, math.inf), (5.0, 6.0)),
        ((-math.inf, -5.0), (-6.0, -5.0)),
    ],
)
def test_commands_cover_their_range(
    bounds: tuple[float, float], expected: tuple[float, float]
) -> None:
    layout, (low, high) = Layout((Feature("motor", "1", *bounds),)), expected
    commands, _ = matched_commands(layout, layout, 1000, 0)
    assert low <= commands.min() < low + 0.05 * (high - low)
    assert high >= commands.max() > high - 0.05 * (high - low)


def test_commands_are_in_both_ranges() -> None:
    """In the intersection, or each in its own range if it is empty; else nearest to zero."""
    wide, narrow, apart = (
        Layout((Feature("motor", "1", *bounds),))
        for bounds in ((-3.0, 3.0), (0.5, 1.0), (5.0, 6.0))
    )
    one, two = matched_commands(wide, narrow, 50, 0)
    np.testing.assert_array_equal(one, two)
    assert one.min() >= 0.5
    assert one.max() <= 1.0
    one, two = matched_commands(narrow, apart, 50, 0)
    assert one.max() <= 1.0
    assert two.min() >= 5.0
    _, alone = matched_commands(Layout(()), narrow, 3, 0)
    np.testing.assert_array_equal(alone, np.full((3, 1), 0.5, np.float32))
