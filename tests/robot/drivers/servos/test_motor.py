"""Dynamics of the simulated servo motor."""

import math

import pytest

from shapechanger.robot.drivers.servos.settings import MODELS
from shapechanger.robot.drivers.servos.simulation import (
    SimulatedMotor,
    pull_spring,
)
from tests.robot.drivers.servos.rigs import feetech, servo


def _motor(model: str = "XL330-M077", direction: int = 1) -> SimulatedMotor:
    made = (feetech if model == "STS3215" else servo)("FDP", model=model, direction=direction)
    return SimulatedMotor(made)


def _run(
    motor: SimulatedMotor, goal_a: float, volts: float, seconds: float, springs: bool = False
) -> float:
    """Return how far the end of the tendon went, m; without a spring it is fixed."""
    travel = 0.0
    for _ in range(round(seconds * 1000)):
        motor.advance(goal_a, volts, travel, 1e-3)
        if springs:
            travel = pull_spring(travel, motor.tension, 1e-3)
    return travel


@pytest.mark.parametrize("name", sorted(MODELS))
def test_the_no_load_speed_matches_the_data_sheet(name: str) -> None:
    """At the stall current limit and without load, the motor reaches its data-sheet speed."""
    model = MODELS[name]
    motor = _motor(name)
    motor.snapped = True
    _run(motor, model.stall_a, model.volts, 3.0)
    assert motor.speed * 60 / (2 * math.pi) == pytest.approx(model.no_load_rpm, rel=0.02)


@pytest.mark.parametrize("name", sorted(MODELS))
@pytest.mark.parametrize("direction", [1, -1])
def test_the_tension_at_a_stop_matches_the_current(name: str, direction: int) -> None:
    """A blocked tendon has the tension kt i / r, within the friction of the gears.

    The tension can exceed the goal: the spool overshoots, and friction holds it there.
    """
    model = MODELS[name]
    motor = _motor(name, direction)
    amperes = 0.4 * model.stall_a
    _run(motor, direction * amperes, model.volts, 1.5)
    pull = model.torque_constant * amperes / 0.005
    friction = MODELS[name].friction_nm / 0.005
    assert motor.tension == pytest.approx(pull, abs=1.01 * friction)
    assert motor.speed == 0.0
