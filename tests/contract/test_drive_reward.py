"""Properties of the driving reward."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.contract.drive_reward import DriveReward
from shapechanger.errors import UnknownName

speeds = st.floats(-10.0, 10.0)
seconds = st.floats(0.0, 1.0)


@given(speed=speeds, dt=seconds)
def test_reversing_costs_what_driving_forward_earns(speed: float, dt: float) -> None:
    """Velocity rewards are antisymmetric (gym-donkeycar#70)."""
    forth, back = (DriveReward().terms(v, None, None, dt) for v in (speed, -speed))
    assert forth["reward_velocity"] == -back["reward_velocity"]


@given(speed=speeds, dt=seconds)
def test_the_reward_does_not_depend_on_the_control_rate(speed: float, dt: float) -> None:
    """Without a collision, two steps of half the duration have the rewards of one whole step."""
    whole = DriveReward().terms(speed, False, True, dt)
    half = DriveReward().terms(speed, False, True, dt / 2)
    for name in whole:
        assert math.isclose(whole[name], 2 * half[name], abs_tol=1e-12)


@pytest.mark.parametrize(
    ("quantities", "names"),
    [
        ((None, None, None), set()),
        ((1.0, None, None), {"reward_velocity"}),
        ((None, False, None), {"reward_collision"}),
        ((None, None, True), {"reward_stall"}),
        ((1.0, True, True), {"reward_velocity", "reward_collision", "reward_stall"}),
    ],
)
def test_unmeasured_quantities_have_no_term(
    quantities: tuple[float | None, bool | None, bool | None], names: set[str]
) -> None:
    assert set(DriveReward().terms(*quantities, 0.1)) == names


def test_terms_are_weighted() -> None:
    """Terms are weights times metres, collisions and stalled seconds."""
    reward = DriveReward(velocity=2.0, collision=-5.0, stall=-3.0)
    assert reward.terms(1.5, True, True, 0.1) == {
        "reward_velocity": pytest.approx(0.3),
        "reward_collision": -5.0,
        "reward_stall": pytest.approx(-0.3),
    }


@pytest.mark.parametrize(
    ("ends", "collided", "over"), [(True, True, True), (True, None, False), (False, True, False)]
)
def test_a_collision_ends_the_episode_if_configured(
    ends: bool, collided: bool | None, over: bool
) -> None:
    assert DriveReward(collision_ends_episode=ends).ends(collided) is over


def test_weights_are_set_by_name() -> None:
    given_ = DriveReward.from_weights({"velocity": 3, "collision_ends_episode": 0.0})
    assert given_ == DriveReward(velocity=3.0, collision_ends_episode=False)
    assert DriveReward.from_weights({}) == DriveReward()
    with pytest.raises(UnknownName, match="Did you mean 'velocity'"):
        DriveReward.from_weights({"velocty": 1.0})
