"""The boat: gliding, drift, currents and twin propellers."""

from __future__ import annotations

import math

import pytest

from tests.vehicles.bodies.grounds import AHEAD, TO_THE_LEFT, ground


def test_a_boat_has_no_brakes() -> None:
    here = ground("boat")
    here.drive(6.0, AHEAD["boat"])
    fast = here.vehicle.motion().speed
    here.drive(1.0, {"propeller": 0.0, "rudder": 0.0})
    assert 0.3 * fast < here.vehicle.motion().speed < 0.95 * fast
    assert here.vehicle.current_a() == 0.0


def test_a_boat_slows_down_and_drifts_outwards_in_a_turn() -> None:
    here = ground("boat")
    here.drive(8.0, {**TO_THE_LEFT["boat"], "rudder": 0.0})
    straight = here.vehicle.motion().speed
    here.drive(8.0, TO_THE_LEFT["boat"])
    assert here.vehicle.motion().speed < 0.85 * straight
    assert here.vehicle.motion().lateral_speed < -0.1 * here.vehicle.motion().speed
    drift = math.atan2(-here.vehicle.motion().lateral_speed, here.vehicle.motion().speed)
    assert math.radians(8.0) < drift < math.radians(35.0)
    radius = here.pace() / here.vehicle.motion().yaw_rate
    assert radius == pytest.approx(here.kind.turning_radius_m, rel=0.25)


def test_motion_is_relative_to_the_current() -> None:
    still, flowing = ground("boat"), ground("boat")
    flowing.vehicle.set_current(0.2, -0.1)
    flowing.data.qvel[0:2] = (0.2, -0.1)
    for here in (still, flowing):
        here.drive(5.0, TO_THE_LEFT["boat"])
    a, b = still.vehicle.motion(), flowing.vehicle.motion()
    assert (b.x - 1.0, b.y + 0.5, b.heading) == pytest.approx((a.x, a.y, a.heading), abs=1e-6)
    assert flowing.vehicle.travelled_m() == pytest.approx(still.vehicle.travelled_m(), abs=1e-6)


def test_the_rudder_needs_flow() -> None:
    here = ground("boat")
    here.drive(2.0, {"propeller": 0.0, "rudder": -1.0})
    assert abs(here.vehicle.motion().yaw_rate) < 1e-3
    here.drive(0.7, {"propeller": 0.7, "rudder": -1.0})
    assert here.vehicle.motion().yaw_rate > 0.05
    here.vehicle.place(0.0, 0.0, 0.0)
    here.drive(5.0, AHEAD["boat"])
    here.drive(1.0, {"propeller": 0.0, "rudder": -1.0})
    assert here.vehicle.motion().yaw_rate > 0.1


def test_two_propellers_steer() -> None:
    here = ground("boat")
    both = {"left propeller": 1.0, "right propeller": 1.0}
    here.vehicle.drive(both, 7.2)
    assert here.vehicle.current_a() == pytest.approx(14.4)
    here.drive(8.0, both)
    assert abs(here.vehicle.motion().y) < 0.05
    assert here.vehicle.motion().speed == pytest.approx(here.kind.top_speed_mps, rel=0.1)
    here.drive(4.0, {"left propeller": 0.2, "right propeller": 0.8})
    assert here.vehicle.motion().yaw_rate > 0.2
    here.vehicle.place(0.0, 0.0, 0.0)
    here.drive(8.0, {"left propeller": 0.8, "right propeller": -1.0})
    assert here.vehicle.motion().yaw_rate < -0.3
    assert here.pace() < 0.5
