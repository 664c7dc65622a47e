"""Land vehicles: turning, slip and the trailer."""

from __future__ import annotations

import math

import pytest

from tests.vehicles.bodies.grounds import AHEAD, Ground, ground


@pytest.mark.parametrize("name", ["car", "truck"])
@pytest.mark.parametrize("throttle", [0.25, 0.6])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_turning_radius_follows_from_geometry(name: str, throttle: float, side: float) -> None:
    here = ground(name)
    here.drive(8.0, {"wheels": throttle, "steering": side})
    radius = here.pace() / abs(here.vehicle.motion().yaw_rate)
    assert radius == pytest.approx(here.kind.turning_radius_m, rel=0.15)


def test_wheel_angles_satisfy_ackermann() -> None:
    here = ground("car")
    here.drive(1.0, {"steering": -1.0})
    left, right = (
        float(here.data.joint(f"vehicle/{s} steering").qpos[0]) for s in ("left", "right")
    )
    assert left > right > 0.3
    # Ackermann: the cotangents differ by gauge over wheelbase.
    assert 1 / math.tan(right) - 1 / math.tan(left) == pytest.approx(0.140 / 0.26, rel=0.02)


def test_the_servo_has_a_limited_speed_and_keeps_its_angle_without_pulses() -> None:
    here = ground("car")
    here.drive(1.0, {"steering": -1.0})
    joint = here.data.joint("vehicle/left steering")
    before = float(joint.qpos[0])
    here.drive(1.0, {"steering": None})
    assert float(joint.qpos[0]) == pytest.approx(before)
    here.drive(0.05, {"steering": 1.0})
    moved = before - float(joint.qpos[0])
    assert 0.02 < moved < 0.05 * math.radians(60.0) / 0.19
    here.drive(0.5, {"steering": 1.0})
    assert float(joint.qpos[0]) < -0.3


def test_the_car_slips_on_ice() -> None:
    dry, ice = ground("car"), ground("car", friction=0.3)
    for here in (dry, ice):
        here.drive(0.3, AHEAD["car"])
    assert ice.vehicle.motion().speed < 0.7 * dry.vehicle.motion().speed
    assert ice.vehicle.travelled_m() > 1.3 * ice.vehicle.motion().x
    slips: list[float] = []
    for here in (dry, ice):
        most = 0.0
        for _ in range(20):
            here.drive(0.1, {"wheels": 1.0, "steering": -1.0})
            aside, ahead = (
                abs(here.vehicle.motion().lateral_speed),
                abs(here.vehicle.motion().speed),
            )
            most = max(most, math.atan2(aside, ahead))
        slips.append(most)
    assert slips[0] < math.radians(20.0)
    assert slips[1] > 2.0 * slips[0]


@pytest.mark.parametrize("name", ["car", "truck"])
def test_a_vehicle_scrapes_along_a_wall(name: str) -> None:
    here = ground(name, wall_x=1.0)
    here.vehicle.place(0.7, -4.0, math.radians(80.0))
    upright, height = 1.0, 0.0
    for _ in range(50):
        here.drive(0.1, {"wheels": 1.0, "steering": 0.5})
        upright = min(upright, here.uprightness())
        height = max(height, abs(here.height()))
    assert upright > 0.99
    assert height < 0.02
    assert here.vehicle.motion().y > -2.5


def test_the_tank_turns_on_the_spot() -> None:
    here = ground("tank")
    here.drive(3.0, {"left track": -0.5, "right track": 0.5})
    pose = here.vehicle.motion()
    assert math.hypot(pose.x, pose.y) < 0.05
    assert here.vehicle.motion().yaw_rate > 0.8
    assert abs(here.vehicle.travelled_m()) < 0.05


def _hitch(here: Ground) -> float:
    return float(here.data.joint("vehicle/trailer yaw").qpos[0])


def test_the_trailer_follows() -> None:
    here = ground("truck")
    here.drive(6.0, {"wheels": 0.4, "steering": -0.7})
    bent = _hitch(here)
    assert -math.radians(60.0) < bent < -math.radians(10.0)  # Right of the tractor's heading.
    here.drive(5.0, {"wheels": 0.4, "steering": 0.0})
    assert abs(_hitch(here)) < math.radians(2.0)


def test_jackknife_going_backward() -> None:
    here = ground("truck")
    here.drive(1.0, {"wheels": 0.4, "steering": -0.3})
    here.drive(8.0, {"wheels": -0.5, "steering": -0.3})
    assert abs(_hitch(here)) > math.radians(45.0)
