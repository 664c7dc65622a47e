"""Dynamics of the simulated servo motor."""

import math

import pytest

from shapechanger.robot.drivers.servos.settings import MODELS
from shapechanger.robot.drivers.servos.simulation import (
    CABLE_N_PER_M,
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


def test_friction_and_a_slack_tendon_hold_nothing_taut() -> None:
    """Friction holds a torque below it, and a tendon carries no compression."""
    model = MODELS["XL330-M288"]
    motor = _motor(model.name)
    angle = motor.angle
    _run(motor, 0.9 * model.friction_nm / model.torque_constant, 5.0, 0.5)
    assert (motor.angle, motor.tension) == (angle, 0.0)
    _run(motor, -0.3, 5.0, 0.3)
    assert motor.angle < angle - 1.0
    assert motor.tension == 0.0


def test_a_pull_ends_at_the_stop_of_its_load() -> None:
    motor = _motor()
    start = motor.angle
    assert _run(motor, 0.5, 5.0, 2.0, springs=True) == 0.02
    stretch = motor.tension / CABLE_N_PER_M
    assert (motor.angle - start) * 0.005 == pytest.approx(0.02 + stretch, abs=1e-6)


def test_the_temperature_rises_with_the_square_of_the_current() -> None:
    """The temperature rise is proportional to i^2 and follows the thermal time constant."""
    rises: list[float] = []
    for share in (0.25, 0.5):
        motor = _motor()
        motor.advance(share * 1.47, 5.0, 0.0, 120.0)
        rises.append(motor.temperature - 25.0)
    assert rises[1] == pytest.approx(4 * rises[0], rel=1e-9)
    assert rises[1] == pytest.approx(30 * 3.401 * 0.735**2 * (1 - math.exp(-1)), rel=1e-3)
