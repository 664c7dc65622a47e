"""Parts, motors, steering and motion of each kind of vehicle, and the counting of collisions."""

import math

import mujoco
import pytest

from shapechanger.errors import ProfileError
from shapechanger.vehicles.bodies import require_fit
from shapechanger.vehicles.bodies.model import APART_S, BUMPER_SPREAD, ContactTracker, Motion
from shapechanger.vehicles.bodies.parts import HOBBY_MOTOR
from tests.vehicles.bodies.grounds import TO_THE_LEFT, Ground, ground


@pytest.mark.parametrize(
    ("name", "parts", "message"),
    [
        ("car", {"wheels"}, "The robot drives 'wheels'; a car is driven by 'steering' and"),
        ("car", {"wheels", "steering", "bed"}, "The robot drives 'bed' and 'steering' and"),
        ("truck", {"gear"}, "The robot drives nothing;"),
        ("boat", {"propeller", "left propeller", "right propeller"}, ", or by 'left propeller'"),
    ],
)
def test_robots_with_other_parts_are_refused(name: str, parts: set[str], message: str) -> None:
    with pytest.raises(ProfileError) as caught:
        require_fit(name, parts)
    assert message in str(caught.value)


def test_the_motor_matches_its_data_sheet() -> None:
    """The data sheet states, at 6 V, 6 A and 1.2 kgf·cm at stall, and 0.5 A at 2200 rpm."""
    free = 2200.0 * 2.0 * 3.141592653589793 / 60.0
    assert HOBBY_MOTOR.amperes(6.0, 0.0) == pytest.approx(6.0)
    assert HOBBY_MOTOR.amperes(6.0, free) == pytest.approx(0.5)
    assert HOBBY_MOTOR.torque_per_current * 6.0 == pytest.approx(1.2 * 0.0980665)


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
    # Ackermann: the difference of the cotangents is the gauge divided by the wheelbase.
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


_DT = 0.01
# A movable ball of 0.1 m, a wall with its face at x = 1 m, and the ground.
_MODEL = """
<mujoco><option gravity="0 0 0"/><worldbody>
<geom name="world/ground" type="plane" size="5 5 1"/>
<geom name="world/wall/0" type="box" pos="1.5 0 0.5" size="0.5 3 0.5"/>
<body name="vehicle/chassis" pos="0 0 0.1"><freejoint/>
<geom name="vehicle/hull" type="sphere" size="0.1"/></body>
</worldbody></mujoco>
"""


class _Bench:
    def __init__(self) -> None:
        self.model = mujoco.MjModel.from_xml_string(_MODEL)
        self.data = mujoco.MjData(self.model)
        self.touch = ContactTracker(self.model)

    def stand(self, x: float, seconds: float = _DT, heading: float = 0.0) -> None:
        self.data.qpos[:3] = x, 0.0, 0.1
        mujoco.mj_forward(self.model, self.data)
        for _ in range(round(seconds / _DT)):
            self.touch.follow(self.data, Motion(x, 0.0, heading, 0.0, 0.0, 0.0), _DT)


def test_contacts_within_half_a_second_are_one_collision() -> None:
    bench = _Bench()
    bench.stand(0.91, seconds=3.0)
    assert bench.touch.touches
    for away, collisions in ((0.9 * APART_S, 1), (1.1 * APART_S, 2)):
        bench.stand(0.5, seconds=away)
        assert not bench.touch.touches
        bench.stand(0.91)
        assert bench.touch.collisions == collisions


@pytest.mark.parametrize(
    ("off", "felt"), [(0.0, True), (0.9, True), (-0.9, True), (1.1, False), (math.pi, False)]
)
def test_the_bumper_is_at_the_front(off: float, felt: bool) -> None:
    """Contacts at the side or rear are collisions that do not press the bumper.

    `off` is the bearing of the wall divided by `BUMPER_SPREAD`, or pi for a wall behind.
    """
    bench = _Bench()
    bench.stand(0.91, heading=off if off == math.pi else off * BUMPER_SPREAD)
    assert bench.touch.collisions == 1
    assert bench.touch.bumped is felt
