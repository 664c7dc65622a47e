"""The robot and the console as devices of LeRobot, call by call."""

from __future__ import annotations

import contextlib
import math
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lerobot.robots import make_robot_from_config
from lerobot.teleoperators import make_teleoperator_from_config
from lerobot.utils.errors import DeviceAlreadyConnectedError, DeviceNotConnectedError
from robot.client.robot import Robot

from lerobot_robot_shapechanger import (
    Shapechanger,
    ShapechangerConfig,
    ShapechangerConsole,
    ShapechangerConsoleConfig,
)
from shapechanger.errors import LinkError, RobotRefused, SpaceMismatch, UnknownName
from shapechanger.robot.client.known_robots import forget, remember
from shapechanger.robot.link import messages as m
from shapechanger.robot.twin.robot import RunningRobot

AHEAD = {"steering": 0.25, "throttle": 0.5}
BACK = (-0.5, -0.4)
REST = {"steering": 0.0, "throttle": 0.0}


def lab_car(**how: Any) -> Shapechanger:
    """Make the robot as LeRobot does."""
    robot = make_robot_from_config(ShapechangerConfig(id="lab-car", **how))
    assert isinstance(robot, Shapechanger)
    return robot


def console() -> ShapechangerConsole:
    """Make the teleoperator as LeRobot does."""
    teleop = make_teleoperator_from_config(ShapechangerConsoleConfig(id="lab-car"))
    assert isinstance(teleop, ShapechangerConsole)
    return teleop


def throttle(car: Shapechanger) -> float:
    """Drive ahead for a step, and return the applied throttle."""
    car.send_action(AHEAD)
    return car.get_observation()["throttle/applied"]


@pytest.fixture
def tin(tmp_path: Path) -> Iterator[Callable[..., Robot]]:
    """Start a fake robot, known as `tin`."""
    with contextlib.ExitStack() as stack:

        def start(**what: Any) -> Robot:
            robot = stack.enter_context(Robot(**{"clock": "real", **what}).running(tmp_path))
            remember(robot.known)
            stack.callback(forget, "tin")
            return robot

        yield start


def test_features_equal_the_layouts(robot: RunningRobot) -> None:
    """Features are known before `connect`, and observations have exactly these features."""
    car = lab_car()
    assert car.action_features == {"steering": float, "throttle": float}
    assert car.action_features == console().action_features
    features = car.observation_features
    assert features["camera"] == (120, 160, 3)
    assert {"speed", "battery", "throttle/applied"} < set(features)
    assert not car.is_connected
    with car:
        seen = car.get_observation()
    assert seen.keys() == features.keys()
    assert seen["camera"].dtype == np.uint8
    assert seen["camera"].shape == (120, 160, 3)
    numbers = [value for name, value in seen.items() if name != "camera"]
    assert all(type(value) is float and math.isfinite(value) for value in numbers)


def test_a_program_drives_until_a_person_takes_over(
    robot: RunningRobot, person: Any, until: Any
) -> None:
    """The robot applies the person's commands, and `send_action` returns them; P ends that."""
    with lab_car() as car, console() as teleop:
        until(lambda: throttle(car) > 0.0)
        assert car.send_action(AHEAD) == AHEAD
        assert teleop.get_action() == REST

        person.drive(BACK)
        by_person = pytest.approx(dict(zip(AHEAD, BACK, strict=True)))
        until(lambda: bool(car.get_observation() and car.send_action(AHEAD) == by_person))
        until(lambda: teleop.get_action() == by_person)
        until(lambda: throttle(car) < 0.0 and any(seen.suggested for seen in person.seen))
        assert person.seen[-1].suggested == pytest.approx(tuple(AHEAD.values()))
        assert person.seen[-1].suggested_by == "lerobot"

        stop = threading.Event()
        driving = threading.Thread(target=lambda: _drive(car, stop))
        driving.start()
        person.let_a_program_drive()
        until(lambda: person.client.ask().message.action_applied[1] > 0.0)
        stop.set()
        driving.join()
        assert teleop.get_action() == REST


def test_an_emergency_stop_is_a_warning(
    robot: RunningRobot, person: Any, until: Any, caplog: pytest.LogCaptureFixture
) -> None:
    """After an emergency stop the robot stays at rest, and LeRobot's loop goes on."""
    with lab_car() as car:
        until(lambda: throttle(car) > 0.0)
        person.client.emergency_stop("enough")
        until(lambda: bool(car.get_observation() and "Emergency stop" in caplog.text))
        until(lambda: throttle(car) == 0.0)
        assert "Grace: enough" in caplog.text
    until(lambda: person.client.ask().message.emergency)
    person.client.take()
    person.client.arm()


def test_disconnecting_stops_the_robot(robot: RunningRobot, person: Any, until: Any) -> None:
    """After `disconnect` the robot is disarmed, and no client has control."""
    car = lab_car()
    with pytest.raises(DeviceNotConnectedError, match="lab-car is not connected"):
        car.get_observation()
    car.connect()
    with pytest.raises(DeviceAlreadyConnectedError, match="lab-car is connected already"):
        car.connect()
    until(lambda: throttle(car) > 0.0)
    car.disconnect()
    car.disconnect()
    until(lambda: not person.client.ask().message.holder)
    until(lambda: not person.client.ask().message.armed)
    until(lambda: not any(person.client.ask().message.action_applied))


def test_actions_are_checked(robot: RunningRobot) -> None:
    """Wrong names and numbers are refused in a sentence; too large numbers are clipped."""
    with lab_car() as car:
        car.get_observation()
        assert car.send_action({"steering": -3, "throttle": 0}) == {"steering": -1, "throttle": 0}
        with pytest.raises(UnknownName, match=r"'stering'\. Did you mean 'steering'"):
            car.send_action({"stering": 0.0, "throttle": 0.0})
        with pytest.raises(SpaceMismatch, match="throttle is missing"):
            car.send_action({"steering": 0.0})
        with pytest.raises(SpaceMismatch, match="finite"):
            car.send_action({"steering": math.nan, "throttle": 0.0})


@pytest.mark.parametrize("make", [lab_car, console])
def test_the_name_of_the_robot_is_checked(robot: RunningRobot, make: Callable[[], Any]) -> None:
    """The error for a wrong name suggests the nearest name; for a missing one it lists all."""
    device = make()
    wrong = type(device)(device.config_class(id="lab-cra"))
    with pytest.raises(UnknownName, match=r"'lab-cra'\. Did you mean 'lab-car'"):
        wrong.connect()
    with pytest.raises(LinkError, match=r"the name of a known robot\. There are: lab-car"):
        type(device)(device.config_class()).connect()


def test_only_a_person_arms_a_robot_whose_profile_requires_it(tin: Callable[..., Robot]) -> None:
    """LeRobot does not drive before a person arms the robot, and gives up with one sentence."""
    fake = tin(arming="person")
    car = Shapechanger(ShapechangerConfig(id="tin", wait_s=0.2))
    with pytest.raises(RobotRefused, match=r"After 0.2 s, tin waits for a person: run .* with P"):
        car.connect()
    assert not car.is_connected
    assert not fake.received(m.Arm)
    assert not fake.received(m.Command)
    fake.arm_by_itself = True  # A person arms it once a program has control.
    with car:
        car.send_action(AHEAD)
        car.get_observation()
    assert not fake.received(m.Arm)


def test_a_missing_measurement_is_not_nan(
    tin: Callable[..., Robot], caplog: pytest.LogCaptureFixture
) -> None:
    """A missing measurement is the middle of its range, or 0 if that is infinite; it is logged."""
    tin(absent=("collision", "battery"))
    with Shapechanger(ShapechangerConfig(id="tin")) as car:
        seen = [car.get_observation() for _ in range(3)][-1]
    assert seen["collision"] == 0.5
    assert seen["battery"] == 0.0
    assert caplog.text.count("Nothing measures battery, collision") == 1


def test_a_robot_without_a_camera_has_no_image(tin: Callable[..., Robot]) -> None:
    """The observation contains only the state."""
    tin(image_size=None)
    with Shapechanger(ShapechangerConfig(id="tin")) as car:
        assert car.cameras == {}
        assert car.get_observation().keys() == car.observation_features.keys()
        assert all(kind is float for kind in car.observation_features.values())


def test_a_camera_that_sends_no_image_is_reported(tin: Callable[..., Robot]) -> None:
    """`connect` waits at most `wait_s` for an image."""
    tin(jpeg=b"no picture")
    car = Shapechanger(ShapechangerConfig(id="tin", wait_s=0.2))
    with pytest.raises(RobotRefused, match="sends no picture"):
        car.connect()


def test_a_twin_whose_time_moves_in_steps_is_refused(tin: Callable[..., Robot]) -> None:
    """A twin that is stepped is refused, because LeRobot runs in real time."""
    tin(clock="twin")
    for device in (
        Shapechanger(ShapechangerConfig(id="tin")),
        ShapechangerConsole(ShapechangerConsoleConfig(id="tin")),
    ):
        with pytest.raises(RobotRefused, match="moves only in steps"):
            device.connect()


@pytest.mark.parametrize("fault", ["cut", "silent"])
def test_a_lost_link_ends_the_loop(tin: Callable[..., Robot], fault: str) -> None:
    """The error for a cut or silent link is one sentence, and the robot can be connected again."""
    fake = tin()
    with Shapechanger(ShapechangerConfig(id="tin")) as car:
        car.get_observation()
        if fault == "cut":
            fake.cut()
        else:
            fake.silent = True
        with pytest.raises(LinkError) as lost:
            _drive(car, threading.Event())
        assert len(str(lost.value).splitlines()) == 1
        assert not car.is_connected
        fake.silent = False
        car.connect()
        car.get_observation()


def _drive(car: Shapechanger, stop: threading.Event) -> None:
    while not stop.wait(1 / 50):  # The robot refuses more than 500 messages per second.
        car.get_observation()
        car.send_action(AHEAD)
