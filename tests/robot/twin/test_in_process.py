"""An in-process robot: arming, driving, stopping and restarting."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import simplejpeg

from shapechanger.errors import RobotError
from shapechanger.layout import Layout
from shapechanger.robot.guard.messages import Order
from shapechanger.robot.link.messages import Observation
from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.robot.twin.in_process import InProcessRobot
from shapechanger.robot.twin.world.vehicle import DrivingWorld
from tests.robots import CAR, SWAPPED_WAYS, changed, write_profile

_PARTS = {"wheels", "steering"}


def _robot(world: DrivingWorld | None = None, *, pictures: bool = False) -> InProcessRobot:
    profile = load_profile(find_profile("lab-car"))
    return InProcessRobot(profile, world or _room(), pictures=pictures)


def _room() -> DrivingWorld:
    return DrivingWorld(_PARTS, (160, 120), seed=1)


def _speed(robot: InProcessRobot, seen: Observation) -> float:
    names = Layout.from_json(robot.welcome.state_layout).names
    return seen.state[names.index("speed")]


def test_a_step_is_one_control_period() -> None:
    """A step advances time by 1/20 s and returns the observation after its command."""
    robot = _robot()
    first = robot.start()
    seen, bumped = robot.step((0.0, 0.5))
    assert seen.state_ns - first.state_ns == 50_000_000
    assert robot.now_ns == seen.state_ns
    assert seen.seq == first.seq + 1
    assert not bumped
    robot.close()


def test_the_throttle_follows_the_slew_limit() -> None:
    """The applied throttle rises by the profile's slew, and the encoder measures the speed."""
    world = _room()
    robot = _robot(world)
    robot.start(lambda: world.place(2))
    begin = world.inputs().travelled_m
    applied = [robot.step((0.0, 1.0))[0].action_applied[1] for _ in range(10)]
    assert applied == pytest.approx([min(1.0, 0.2 * (i + 1)) for i in range(10)])
    seen = robot.step((0.0, 1.0))[0]
    assert world.inputs().travelled_m > begin + 0.1
    assert _speed(robot, seen) > 0.3
    robot.close()


def test_it_starts_armed_and_describes_itself() -> None:
    """The robot is armed after `start`, and its welcome describes it."""
    robot = _robot()
    seen = robot.start()
    assert seen.armed
    assert not seen.emergency
    assert robot.welcome.robot == "lab-car"
    assert robot.welcome.clock == "twin"
    assert robot.welcome.image_size is None
    robot.close()


def test_it_can_be_armed_again_after_an_emergency_stop() -> None:
    """`arm` clears an emergency stop."""
    robot = _robot()
    robot.start()
    robot._orders.waiting.append(Order("emergency", reason="A hand in the way."))
    assert robot.step((0.0, 0.5))[0].emergency
    robot.arm()
    seen, _ = robot.step((0.0, 0.5))
    assert seen.armed
    assert not seen.emergency
    robot.close()


def test_a_start_resets_the_robot() -> None:
    """After `start`, earlier commands have no effect and the observation is reproducible."""
    world = _room()
    robot = _robot(world)
    first = robot.start(lambda: world.place(2))
    for _ in range(20):
        robot.step((0.5, 1.0))
    again = robot.start(lambda: world.place(2))
    assert world.inputs().speed == 0.0
    assert (again.state, again.action_applied) == (first.state, first.action_applied)
    assert again.state_ns == first.state_ns
    robot.close()


def test_swapped_pins_drive_backward(tmp_path: Path) -> None:
    """The pins of the profile drive the world: swapping them reverses the motion."""
    travelled: list[float] = []
    for text in (CAR, SWAPPED_WAYS):
        # Swap the pins of the driver only, not those of the wiring.
        world = _room()
        profile = write_profile(tmp_path, text)
        robot = InProcessRobot(
            profile, world, pictures=False, wired_as=write_profile(tmp_path, CAR).guard_plan()
        )
        robot.start(lambda world=world: world.place(2))
        for _ in range(10):
            robot.step((0.0, 1.0))
        travelled.append(world.inputs().travelled_m)
        robot.close()
    assert travelled[0] > 0.1
    assert travelled[1] == pytest.approx(-travelled[0], rel=0.05)


def test_a_refused_command_gives_its_reason_once() -> None:
    """`refused` holds the reason of a refused command, and is cleared when read."""
    robot = _robot()  # Not armed before its start.
    robot.step((0.0, 1.0))
    assert robot.refused
    assert not robot.refused
    robot.close()


def test_a_bump_between_observations_is_reported() -> None:
    """A bump that starts and ends between two observations is reported."""
    world = _room()
    robot = _robot(world)
    robot.start(lambda: world.place(2))
    bumps = sum(robot.step((0.0, 1.0))[1] for _ in range(200))
    assert bumps == 1
    robot.close()


def test_frames_show_the_world() -> None:
    """Each observation carries a new JPEG frame of the world, captured at the same time."""
    world = _room()
    robot = _robot(world, pictures=True)
    seen = robot.start()
    assert robot.welcome.image_size == (160, 120)
    assert seen.frame is not None
    picture = simplejpeg.decode_jpeg(seen.frame, "RGB")
    assert np.abs(picture.astype(float) - world.picture()).mean() < 5.0
    assert seen.captured_ns == seen.state_ns
    after = robot.step((0.0, 0.0))[0]
    assert after.frame_seq == seen.frame_seq + 1
    # Frame numbers must not repeat after a restart.
    assert robot.start().frame_seq > after.frame_seq
    robot.close()


def test_a_closed_robot_refuses_steps() -> None:
    """Closing is idempotent, and `start` reopens the robot."""
    world = _room()
    robot = _robot(world)
    robot.start()
    robot.step((0.0, 1.0))
    robot.close()
    robot.close()
    with pytest.raises(RobotError, match="is closed"):
        robot.step((0.0, 1.0))
    assert robot.start().armed
    robot.close()


def test_a_sensor_that_is_not_wired_is_refused(tmp_path: Path) -> None:
    """An unwired sensor raises the guard's error at construction."""
    unwired = changed('[sensor.pack]\ndriver = "ina219"\n', "")
    attached = write_profile(tmp_path, unwired.replace("low_battery_v = 6.6\n", "")).guard_plan()
    profile = write_profile(tmp_path, CAR)
    with pytest.raises(RobotError, match=r"Sensor 'pack' .* does not answer"):
        InProcessRobot(profile, _room(), pictures=False, wired_as=attached)
