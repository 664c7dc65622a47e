"""Rollouts of two environments under the same commands."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from shapechanger.layout import Feature, Layout
from shapechanger.morphology.certificate import certify, compare_rollouts, matched_commands
from tests.morphology.swing import Broken, Dictionary, Longer, Noisy, Swing, Wrapper


@pytest.mark.parametrize("wrapped", [lambda env: env, Dictionary, Broken])
@pytest.mark.parametrize("steps", [0, 20])
def test_equal_environments_have_equal_rollouts(wrapped: Any, steps: int) -> None:
    """Also one env twice, dictionaries in the order of their keys, and equal NaN."""
    env = wrapped(Swing())
    for target in (wrapped(Swing()), env):
        rollout = compare_rollouts(env, target, steps=steps)
        assert rollout.identical
        assert rollout.differs_by_rounding
        assert str(rollout) == (
            f"{steps} steps from the same seed with the same commands: the 2 numbers that both "
            "observe are equal throughout."
        )


def test_the_first_and_the_largest_difference_are_reported() -> None:
    source, target = Swing(), Swing(length=0.8)
    text = str(compare_rollouts(source, target, steps=25, seed=3))
    commands, _ = matched_commands(source.action_layout, target.action_layout, 25, 3)
    seen = [
        np.stack([env.reset(seed=3)[0], *(env.step(command)[0] for command in commands)])
        for env in (source, target)
    ]
    gap = np.abs(seen[0] - seen[1])
    step, feature = np.unravel_index(np.argmax(gap), gap.shape)
    name = source.observation_layout.names[feature]
    assert "observations part at step 1 in hinge/velocity, and furthest at step" in text
    assert f"at step {step} in {name}, by {gap.max():.4g}. Rewards differ by up to" in text


def test_motors_of_the_same_name_get_the_same_commands() -> None:
    source, target = Swing(), Swing(wrist=True)
    rollout = compare_rollouts(source, target, steps=10)
    assert "Only the target observes 2 more, such as wrist/angle." in str(rollout)
    one, two = np.asarray(source.commands), np.asarray(target.commands)
    assert one.dtype == np.float32
    assert np.all(np.abs(one) <= 1.0)
    assert len(np.unique(one)) == 10
    np.testing.assert_array_equal(one[:, 0], two[:, 0])
    np.testing.assert_array_equal(two[:, 1], 0.0)
    compare_rollouts(source, target, steps=10, seed=1)
    assert not np.array_equal(one, np.asarray(source.commands))


@pytest.mark.parametrize(
    ("source", "target", "steps", "sentence"),
    [
        (Swing, lambda: Swing(limit=7), 7, "equal throughout. Only the target ended its episode."),
        (lambda: Swing(limit=3), lambda: Swing(limit=7), 3, "Only the source ended its episode."),
        (Swing, lambda: Swing(bonus=1.0), 20, "equal throughout. Rewards differ by up to 1 a step"),
        (Swing, lambda: Noisy(Swing()), 20, "observations part at the reset in hinge/"),
        # NaN on one side is the largest finite difference.
        (Swing, lambda: Broken(Swing()), 20, "in hinge/angle, by 1.798e+308."),
        # A wrapper without a layout of its own: numbers are compared by their places.
        (
            Swing,
            lambda: Longer(Swing()),
            20,
            "Only the target observes 1 more, such as observation[2]",
        ),
        (lambda: Longer(Swing()), lambda: Longer(Swing(gear=2.0)), 20, "in observation[1], by"),
    ],
)
def test_each_difference_is_a_sentence(source: Any, target: Any, steps: int, sentence: str) -> None:
    """None of them is rounding."""
    rollout = compare_rollouts(source(), target(), steps=20)
    assert rollout.steps == steps
    assert not rollout.identical
    assert not rollout.differs_by_rounding
    assert sentence in str(rollout)


def test_equal_ends_of_equal_episodes_are_equal() -> None:
    assert compare_rollouts(Swing(limit=7), Swing(limit=7)).identical


def test_without_common_features_rollouts_differ() -> None:
    """A block has a name per number."""
    target = Swing()
    target.observation_layout = Layout((Feature("block", "1", shape=(2, 1)),))
    rollout = compare_rollouts(Swing(), target, steps=5)
    assert not rollout.differs_by_rounding
    assert "the 0 numbers that both" in str(rollout)
    assert "Only the target observes 2 more, such as block[0]." in str(rollout)


@pytest.mark.parametrize(
    ("bounds", "expected"),
    [
        ((-2.0, 3.0), (-2.0, 3.0)),
        ((-math.inf, math.inf), (-1.0, 1.0)),
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
    assert (one.min() >= 0.5, one.max() <= 1.0) == (True, True)
    one, two = matched_commands(narrow, apart, 50, 0)
    assert (one.max() <= 1.0, two.min() >= 5.0) == (True, True)
    _, alone = matched_commands(Layout(()), narrow, 3, 0)
    np.testing.assert_array_equal(alone, np.full((3, 1), 0.5, np.float32))


class _Late(Wrapper):
    """Wrapper that adds to the observation after some steps."""

    def __init__(self, env: object, after: int, offset: float) -> None:
        super().__init__(env)
        self._left, self._offset = after, offset

    def sensed(self, observation: object) -> object:
        """Add the offset once the steps are over."""
        self._left -= 1
        return observation + (self._offset if self._left < 0 else 0.0)  # type: ignore[operator]


@pytest.mark.parametrize("after", [0, 1, 50, 100])
def test_a_late_shift_is_no_rounding(after: int) -> None:
    """What is sensed may differ late, by little, and between models that round differently."""
    heavy = Swing(mass=1.0 + 1e-15)
    assert not certify(heavy, _Late(Swing(), after, 1e-6)).is_empty
    assert certify(Swing(), _Late(Swing(), after, 1e-12), allow_empty=True).is_empty


def test_another_end_of_the_episode_is_no_rounding() -> None:
    """Equal numbers with another end differ in what the episode is."""

    class _Ends(Wrapper):
        def step(self, action: object, /) -> object:  # type: ignore[override]
            observation, reward, _, *rest = self.env.step(action)
            return (observation, reward, len(self.env.commands) > 30, *rest)

    certificate = certify(Swing(), _Ends(Swing()))
    assert certificate.same_model
    assert not certificate.is_empty
    assert certificate.verdict.endswith("are the same; what is sensed, done or rewarded differs.")
