"""Changes of a profile from a calibration."""

from dataclasses import replace

import pytest

from shapechanger.contract.plan import OutputPlan
from shapechanger.errors import RobotError
from shapechanger.robot.drivers.pulse import ServoKeys
from shapechanger.robot.setup.calibration import (
    motor_changes,
    pulse_changes,
    reading,
    wheel_changes,
    widest_pulses,
)

_SERVO = OutputPlan(
    "steer",
    "servo",
    mix={"steering": 1.0},
    settings={"over": "lgpio", "left_us": 1100, "centre_us": 1500, "right_us": 1900},
)
_MOTOR = OutputPlan("drive", "hbridge", mix={"throttle": 0.6}, settings={"full": 1.0})


@pytest.mark.parametrize(("left_us", "right_us"), [(1100, 1900), (1900, 1100)])
def test_jogged_values_become_pulse_widths(left_us: int, right_us: int) -> None:
    """Reversed servos keep their larger width on the left."""
    narrow = {"over": "lgpio", "left_us": left_us, "right_us": right_us}
    servo = OutputPlan("steer", "servo", settings=narrow)
    wide = replace(servo, settings=narrow | widest_pulses(servo))
    low_us, high_us = (wide.settings[key] for key in ("left_us", "right_us"))
    assert sorted((low_us, high_us)) == [600, 2400]
    assert (low_us < high_us) == (left_us < right_us)
    pulses = ServoKeys(over="lgpio", left_us=low_us, right_us=high_us)
    assert pulse_changes(wide, (-0.5, 0.1, 0.4)) == {
        "output.steer.left_us": round(pulses.width_us(-0.5)),
        "output.steer.centre_us": round(pulses.width_us(0.1)),
        "output.steer.right_us": round(pulses.width_us(0.4)),
    }


def test_impossible_measurements_are_refused() -> None:
    """A middle at an end, a motor that starts at its full duty, and an encoder's wrong wire."""
    with pytest.raises(RobotError, match="must lie between"):
        pulse_changes(_SERVO, (0.2, 0.2, 0.2))
    for duty in (-0.1, 1.0, 2.0):
        with pytest.raises(RobotError, match="must start at a duty"):
            motor_changes(_MOTOR, "forward", duty)
    for measured_m in (0.0, -0.8):
        with pytest.raises(RobotError, match="check its wires"):
            wheel_changes("wheel", 0.21, measured_m)


def test_motors_and_wheels_get_the_measured_settings() -> None:
    """A motor that turned backward gets a negative mix; 0.5 m for 1 m doubles `wheel_m`."""
    assert motor_changes(_MOTOR, "forward", 0.214) == {"output.drive.start": 0.21}
    assert motor_changes(_MOTOR, "backward", 0.2)["output.drive.mix"] == {"throttle": -0.6}
    assert wheel_changes("wheel", 0.21, 0.5) == {"sensor.wheel.wheel_m": 0.42}


def test_an_output_is_described_in_its_own_units() -> None:
    assert reading(_SERVO, 0.5) == "1700 µs"
    assert reading(OutputPlan("drive", "hbridge", settings={"full": 0.8}), -0.25) == "duty 0.20"
