"""Certificates of shifts between vehicles."""

from __future__ import annotations

from contextlib import closing

import gymnasium as gym
import numpy as np
import pytest

from shapechanger.errors import EmptyShift, MorphologyError
from shapechanger.vehicles.envs import VehicleEnv, WaypointEnv


@pytest.fixture
def blind() -> dict[str, bool]:
    """Arguments of vehicles without images."""
    return {"image": False, "put_back": True}


def test_another_vehicle_is_a_shift(blind: dict[str, bool]) -> None:
    """The certificate lists properties and rollouts."""
    with closing(VehicleEnv("car", **blind)) as car, closing(VehicleEnv("tank", **blind)) as tank:
        text = str(VehicleEnv.certify_shift(car, tank))
    assert "length: 0.4 m -> 0.32 m" in text
    assert "driven by: steering and wheels -> left track and right track" in text
    assert "turns on the spot" in text
    assert "camera's angle below the horizon: 0 degrees -> 3 degrees" in text
    assert "straight ahead at a throttle of 0.5 for 20 steps:" in text
    assert "then a steering of -0.5" in text
    assert "waypoints" not in text
    assert "place" not in text  # Both have the corridor as their default world.


@pytest.mark.gl
def test_the_map_of_waypoints_to_each_body_is_shown() -> None:
    """The map shows how each body turns at full steering; actions are a bearing and a speed."""
    with closing(WaypointEnv("car")) as car, closing(WaypointEnv("tank")) as tank:
        text = str(WaypointEnv.certify_shift(car, tank))
        maps = [
            f"{body.response.per_metre:.2f} rad/m and {body.response.per_second:.2f} rad/s"
            for body in (car, tank)
        ]
    assert f"the map of waypoints to this body: {maps[0]} -> {maps[1]}" in text
    assert maps[0] != maps[1]
    assert "straight ahead at a speed of 0.5" in text
    assert "then a bearing of -0.5" in text


def test_the_same_vehicle_is_no_shift(blind: dict[str, bool]) -> None:
    """An empty shift is refused unless allowed."""
    with closing(VehicleEnv("car", **blind)) as one, closing(VehicleEnv("car", **blind)) as two:
        with pytest.raises(EmptyShift, match="nothing to transfer"):
            VehicleEnv.certify_shift(one, two)
        shift = VehicleEnv.certify_shift(one, two, allow_empty=True)
    assert shift.is_empty
    assert shift.changes == ()


@pytest.mark.gl
def test_a_lens_is_a_shift_of_observations() -> None:
    """A lens changes no response of the vehicle."""
    size = (40, 30)
    with (
        closing(VehicleEnv("car", size=size, put_back=True)) as clear,
        closing(VehicleEnv("car", size=size, put_back=True, lenses=("night",))) as dark,
    ):
        shift = VehicleEnv.certify_shift(clear, dark)
    assert shift.changes == ("lenses: none -> night",)
    straight = shift.answers[0].partition(": ")[2].split(" -> ")
    assert straight[0] == straight[1]


def test_wrappers_are_included(blind: dict[str, bool]) -> None:
    """Wrappers that change actions are a shift."""
    with (
        closing(VehicleEnv("car", **blind)) as car,
        closing(gym.wrappers.TransformAction(VehicleEnv("car", **blind), _halved, None)) as lame,
    ):
        shift = VehicleEnv.certify_shift(car, lame)
    assert shift.changes == ()
    assert not shift.is_empty


def _halved(action: np.ndarray) -> np.ndarray:
    return 0.5 * action


@pytest.mark.parametrize("order", [1, -1])
def test_other_envs_are_refused(order: int, blind: dict[str, bool]) -> None:
    """Comparing with another kind of env is refused."""
    with (
        closing(VehicleEnv("car", **blind)) as car,
        closing(gym.make("shapechanger/InvertedPendulum-v1")) as pole,
    ):
        source, target = (car, pole)[::order]
        with pytest.raises(MorphologyError, match=r"is not a vehicle|has no model"):
            source.unwrapped.certify_shift(source, target)  # pyright: ignore[reportAttributeAccessIssue]
