"""Two environments that get the same commands."""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest

from shapechanger.layout import Feature, Layout
from shapechanger.morphology.certificate.rollout import (
    attribute,
    compare_rollouts,
    matched_commands,
    number_names,
)
from tests.morphology.swing import Broken, Dictionary, Longer, Noisy, Swing, Wrapper


def test_the_same_environment_answers_the_same() -> None:
    """Reset with one seed and pushed alike, two equal pendulums stay together."""
    rollout = compare_rollouts(Swing(), Swing(), steps=20)
    assert rollout.identical
    assert rollout.steps == 20
    assert rollout.compared == 2
    assert str(rollout) == (
        "20 steps from the same seed with the same commands: the 2 numbers that both observe are "
        "equal throughout."
    )


def test_one_environment_may_be_both() -> None:
    """The source runs to its end before the target starts."""
    env = Swing()
    assert compare_rollouts(env, env, steps=20).identical


def test_where_two_part_is_told() -> None:
    """A stronger motor shows at the first step, not at the reset, and in the velocity most."""
    rollout = compare_rollouts(Swing(), Swing(gear=2.0), steps=30)
    assert not rollout.identical
    assert rollout.first_step == 1
    assert rollout.first_feature == "hinge/velocity"
    assert rollout.largest_step is not None
    assert rollout.largest_difference > 0.0
    assert "part at step 1 in hinge/velocity" in str(rollout)
    assert "Rewards differ by up to" in str(rollout)


def test_the_largest_difference_is_the_largest() -> None:
    """Checked against the two rollouts themselves."""
    source, target = Swing(), Swing(length=0.8)
    rollout = compare_rollouts(source, target, steps=25, seed=3)
    observations = []
    for env in (source, target):
        seen, commands = (
            [env.reset(seed=3)[0]],
            matched_commands(source.action_layout, target.action_layout, 25, 3)[0],
        )
        seen += [env.step(command)[0] for command in commands]
        observations.append(np.asarray(seen))
    gap = np.abs(observations[0] - observations[1])
    step, feature = np.unravel_index(np.argmax(gap), gap.shape)
    assert rollout.largest_difference == gap.max()
    assert rollout.largest_step == step
    assert rollout.largest_feature == source.observation_layout.names[feature]


def test_motors_of_the_same_name_get_the_same_numbers() -> None:
    """A second motor beside it changes nothing for the first, and itself gets zero."""
    source, target = Swing(), Swing(wrist=True)
    compare_rollouts(source, target, steps=10)
    one, two = np.asarray(source.commands), np.asarray(target.commands)
    assert one.dtype == np.float32
    assert np.all(np.abs(one) <= 1.0)
    assert len(np.unique(one)) == 10
    np.testing.assert_array_equal(one[:, 0], two[:, 0])
    np.testing.assert_array_equal(two[:, 1], 0.0)


def test_another_seed_gives_other_commands() -> None:
    """The seed reaches both the reset and the motors."""
    env = Swing()
    compare_rollouts(env, env, steps=5, seed=0)
    one = np.asarray(env.commands)
    compare_rollouts(env, env, steps=5, seed=1)
    assert not np.array_equal(one, np.asarray(env.commands))


def test_more_numbers_on_one_side_are_told() -> None:
    """Same-named numbers are compared, the others are listed."""
    rollout = compare_rollouts(Swing(), Swing(wrist=True), steps=5)
    assert rollout.compared == 2
    assert rollout.only_in_target == ("wrist/angle", "wrist/velocity")
    assert "Only the target observes 2 more, such as wrist/angle." in str(rollout)
    assert not rollout.identical


def test_the_shorter_episode_ends_the_comparison() -> None:
    """A target that falls after seven steps is compared over seven."""
    rollout = compare_rollouts(Swing(), Swing(limit=7), steps=20)
    assert rollout.steps == 7
    assert (rollout.source_ended, rollout.target_ended) == (False, True)
    assert rollout.first_step is None
    assert not rollout.identical
    assert str(rollout).endswith("Only the target ended its episode.")
    assert compare_rollouts(Swing(limit=7), Swing(limit=7)).identical
    assert "source ended" in str(compare_rollouts(Swing(limit=3), Swing(limit=7)))


def test_another_reward_is_a_difference() -> None:
    """Bodies and senses alike, but not what is asked for."""
    rollout = compare_rollouts(Swing(), Swing(bonus=1.0), steps=5)
    assert rollout.first_step is None
    assert rollout.reward_difference == pytest.approx(1.0)
    assert not rollout.identical


def test_noise_of_a_wrapper_shows_at_the_reset() -> None:
    """What the outermost wrapper gives is what is compared."""
    rollout = compare_rollouts(Swing(), Noisy(Swing()), steps=5)
    assert rollout.first_step == 0
    assert "part at the reset" in str(rollout)


def test_dictionaries_are_compared_part_by_part() -> None:
    """In alphabetical order of their keys."""
    rollout = compare_rollouts(Dictionary(Swing()), Dictionary(Swing()), steps=5)
    assert rollout.identical
    assert rollout.compared == 2


def test_observations_that_no_layout_describes_go_by_their_places() -> None:
    """A wrapper that adds a number makes the layout useless, not the comparison."""
    rollout = compare_rollouts(Longer(Swing()), Longer(Swing(gear=2.0)), steps=5)
    assert rollout.compared == 3
    assert rollout.largest_feature == "observation[1]"
    uneven = compare_rollouts(Swing(), Longer(Swing()), steps=5)
    assert uneven.only_in_target == ("observation[2]",)


def test_nothing_in_common_is_no_agreement() -> None:
    """Two environments that sense different things are different."""
    target = Swing()
    target.observation_layout = Layout((Feature("x", "m"), Feature("y", "m")))
    rollout = compare_rollouts(Swing(), target, steps=5)
    assert rollout.compared == 0
    assert not rollout.identical
    assert "Only the source observes 2 more" in str(rollout)


def test_what_is_no_number_equals_only_itself() -> None:
    """NaN on both sides agrees; on one it is as far away as can be, and still fits into JSON."""
    assert compare_rollouts(Broken(Swing()), Broken(Swing()), steps=3).identical
    rollout = compare_rollouts(Swing(), Broken(Swing()), steps=3)
    assert rollout.largest_difference == sys.float_info.max


def test_no_steps_compare_the_resets() -> None:
    """Zero commands are allowed."""
    rollout = compare_rollouts(Swing(), Swing(), steps=0)
    assert rollout.identical
    assert rollout.steps == 0


def test_attributes_are_found_inside_wrappers() -> None:
    """Gymnasium's wrappers do not pass attributes on."""
    env = Swing()
    assert attribute(Wrapper(Wrapper(env)), "model") is env.model
    assert attribute(env, "model") is env.model
    with pytest.raises(AttributeError):
        attribute(Wrapper(env), "wings")


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (-2.0, 3.0, (-2.0, 3.0)),
        (-math.inf, math.inf, (-1.0, 1.0)),
        (0.0, math.inf, (0.0, 1.0)),
        (5.0, math.inf, (5.0, 6.0)),
        (-math.inf, -5.0, (-6.0, -5.0)),
    ],
)
def test_commands_stay_in_range(low: float, high: float, expected: tuple[float, float]) -> None:
    """Also where a range has no end."""
    layout = Layout((Feature("motor", "1", low, high),))
    commands, _ = matched_commands(layout, layout, 1000, 0)
    assert expected[0] <= commands.min() < expected[0] + 0.05 * (expected[1] - expected[0])
    assert expected[1] >= commands.max() > expected[1] - 0.05 * (expected[1] - expected[0])


def test_commands_lie_where_the_ranges_overlap() -> None:
    """A number that both can do; and where they share none, each does what it can."""
    wide, narrow = Feature("motor", "1", -3.0, 3.0), Feature("motor", "1", 0.5, 1.0)
    one, two = matched_commands(Layout((wide,)), Layout((narrow,)), 50, 0)
    np.testing.assert_array_equal(one, two)
    assert one.min() >= 0.5
    assert one.max() <= 1.0
    apart = Layout((Feature("motor", "1", 5.0, 6.0),))
    one, two = matched_commands(Layout((narrow,)), apart, 50, 0)
    assert one.max() <= 1.0
    assert two.min() >= 5.0


def test_a_motor_that_cannot_rest_gets_the_nearest_to_zero() -> None:
    """Zero out of range is no command."""
    extra = Layout((Feature("only", "1", 0.2, 1.0),))
    _, commands = matched_commands(Layout(()), extra, 3, 0)
    np.testing.assert_array_equal(commands, np.full((3, 1), 0.2, np.float32))


def test_blocks_have_a_name_per_number() -> None:
    """A block of a layout is numbered through."""
    layout = Layout((Feature("x", "m"), Feature("block", "1", shape=(2, 2))))
    assert number_names(layout) == ["x", "block[0]", "block[1]", "block[2]", "block[3]"]
