"""Conversion of tensions and lengths to counts."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.servos.family import MODELS
from shapechanger.robot.drivers.servos.settings import ServoSettings
from tests.robot.drivers.servos.rigs import feetech, servo


@st.composite
def _servos(draw: st.DrawFn) -> ServoSettings:
    model = MODELS[draw(st.sampled_from(sorted(MODELS)))]
    radius = draw(st.floats(0.003, 0.02))
    least = model.torque_constant * model.ampere_per_goal / radius
    most = draw(st.floats(2 * least, model.most_counts * least))
    return ServoSettings(
        name="FDP",
        id=1,
        model=model.name,
        spool_radius_m=radius,
        most_tension_n=most,
        pretension_n=draw(st.floats(least, most)),
        homing_n=most,
        direction=draw(st.sampled_from((1, -1))),
        control="length" if model.family_name == "Feetech" else "tension",
        shortest_m=-0.001,
    )


@given(one=_servos(), tension=st.floats())
def test_goals_stay_between_zero_and_the_cap(one: ServoSettings, tension: float) -> None:
    """Any finite tension maps to a goal between 0 and the cap; non-finite ones raise."""
    if not math.isfinite(tension):
        with pytest.raises(RobotError, match="cannot pull"):
            one.goal_count(tension)
        with pytest.raises(RobotError, match="cannot pull"):
            one.clip(tension)
        return
    pulled = abs(one.goal_count(tension)) * one.newton_per_goal
    assert 0.0 <= pulled <= one.most_tension_n * (1 + 1e-8)
    assert abs(one.goal_count(tension)) <= one.most_counts
    assert one.pretension_n <= one.clip(tension) <= one.most_tension_n


@given(one=_servos(), share=st.floats(0.0, 1.0))
def test_a_tension_is_rounded_down_by_less_than_a_count(one: ServoSettings, share: float) -> None:
    wanted = share * one.most_counts * one.newton_per_goal
    got = abs(one.goal_count(wanted)) * one.newton_per_goal
    assert got <= wanted + 1e-6
    assert wanted - got <= one.newton_per_goal * (1 + 1e-6)


def test_a_known_spool() -> None:
    """An XL330-M288 with 5 mm pulls 0.071 N a count: 0.52 N·m / 1.47 A / 5 mm / 1000."""
    one = servo("FDP", model="XL330-M288")
    assert one.newton_per_goal == pytest.approx(0.0708, abs=1e-4)
    assert one.goal_count(10.0) == 141
    assert servo("FDP", model="XL330-M288", direction=-1).goal_count(10.0) == -141


def test_a_known_spool_of_a_feetech_servo() -> None:
    """A thousandth of 1.91 N·m on 5 mm is 0.382 N, and a count of current 0.0065 x 0.783 / 5 mm."""
    one = feetech("FDP")
    assert one.newton_per_goal == pytest.approx(0.382, abs=1e-4)
    assert (one.goal_count(10.0), one.most_counts) == (26, 157)
    assert feetech("FDP", direction=-1).goal_count(10.0) == 26  # A limit has no sign.
    assert one.tension_n(10) == pytest.approx(10.18, abs=0.01)


def test_the_numbers_of_the_guide() -> None:
    """docs/finger-rig.md states these of an STS3215 on a spool of 10 mm."""
    one, radius = feetech("FDP", spool_radius_m=0.010), 0.010
    assert one.newton_per_goal == pytest.approx(0.19, abs=5e-3)
    assert one.tension_n(1) == pytest.approx(0.5, abs=0.05)
    assert one.known.gears.friction_nm / radius == pytest.approx(5.0, abs=0.5)
    assert one.known.gears.inertia / radius**2 == pytest.approx(260.0, abs=5.0)
    assert math.pi * radius == pytest.approx(0.031, abs=5e-4)


@pytest.mark.parametrize("direction", [1, -1])
def test_winding_in_shortens_the_tendon(direction: int) -> None:
    """One turn changes the length by the circumference of the spool, in either direction."""
    one = servo("FDP", direction=direction)
    turn = 2 * math.pi * 0.005
    assert one.length_m(100 + direction * 4096, 100) == pytest.approx(-turn)
    assert one.lengthening(direction * 1.0) == pytest.approx(-0.005)
    assert one.tension_n(direction * 100) > 0.0
