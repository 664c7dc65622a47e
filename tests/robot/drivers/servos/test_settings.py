"""Settings of servos and their bus, families and models, and the goals of one servo."""

import math
from collections.abc import Callable
from typing import Any, get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.chip import KeyMistake
from shapechanger.robot.drivers.servos.servo import TendonServo
from shapechanger.robot.drivers.servos.settings import (
    MODELS,
    BusSettings,
    ModelName,
    ServoFamily,
    ServoSettings,
)
from shapechanger.robot.drivers.servos.simulation import SimulatedMotor
from tests.robot.drivers.servos.rigs import feetech, servo, settings
from tests.robot.drivers.servos.wire import DYNAMIXEL, FEETECH


@pytest.mark.parametrize(
    ("make", "changes", "text"),
    [
        (servo, {"id": 253}, "must be 0 to 252, not 253"),
        (servo, {"most_tension_n": 60.0}, "must be 0.029 to 51 N with this spool"),
        (servo, {"most_tension_n": math.nan}, "must be 0.029 to 51 N .* not nan N"),
        (servo, {"pretension_n": 21.0}, "must be 0.029 to 20 N, not 21 N"),
        (servo, {"pretension_n": 0.01}, "must be 0.029 to 20 N, not 0.01 N"),
        (servo, {"homing_n": 30.0}, "must be 0.029 to 20 N, not 30 N"),
        (servo, {"control": "length", "shortest_m": 0.0}, "below longest_m, not 0 and 0 m"),
        (
            feetech,
            {"control": "tension"},
            "must be 'length', not 'tension', because a Feetech servo has no control of its curren",
        ),
        (feetech, {"shortest_m": -0.016}, "must be within 0.0157 m of the zero, half a turn"),
        (feetech, {"longest_m": 0.016}, "must be within 0.0157 m of the zero, half a turn"),
        (feetech, {"most_tension_n": 400.0}, "must be 0.38 to 382 N with this spool"),
    ],
)
def test_settings_that_a_servo_does_not_support_are_refused(
    make: Callable[..., object], changes: dict[str, Any], text: str
) -> None:
    with pytest.raises(KeyMistake, match=text) as caught:
        make("FDP", **changes)
    assert caught.value.key in changes


@pytest.mark.parametrize(
    ("changes", "key", "text"),
    [
        ({"baud": 12345}, "baud", "one that the servos have, 9600, 57600.*, not 12345"),
        (
            {"servos": (servo("FDP"), feetech("FDS"))},
            "device",
            "cannot have Dynamixel and Feetech servos",
        ),
        ({"servos": (feetech("FDP"),), "baud": 4_000_000}, "baud", "38400.*, not 4000000"),
    ],
)
def test_invalid_bus_settings_are_refused(changes: dict[str, Any], key: str, text: str) -> None:
    with pytest.raises(KeyMistake, match=text) as caught:
        settings(**changes)
    assert caught.value.key == key


def test_the_table_is_complete() -> None:
    """`ModelName` has all names of `servos.toml`, and both families have all registers in use."""
    assert get_args(ModelName) == tuple(MODELS)
    own = [name for name, one in DYNAMIXEL.registers.items() if one.value is None]
    assert set(own) <= set(FEETECH.registers)
    assert BusSettings(device="x", servos=(servo("FDP"),)).watchdog_ms == 100


@pytest.mark.parametrize("family", [DYNAMIXEL, FEETECH])
@given(value=st.integers(-32766, 32766))
def test_encoded_values_decode_to_themselves(family: ServoFamily, value: int) -> None:
    """Two's complement and a bit for the sign both keep the value."""
    register = family["goal_position"]
    assert register.decode(register.encode(value)) == value


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


def _one(servo: ServoSettings) -> TendonServo:
    made = TendonServo(servo, settings())
    made.zero = 0
    return made


@given(servo=_servos(), tension=st.floats(), share=st.floats(0.0, 1.0))
def test_goals_stay_between_zero_and_the_cap(
    servo: ServoSettings, tension: float, share: float
) -> None:
    """Any finite tension maps to a goal within the cap, rounded down by less than a count."""
    one, unit = _one(servo), servo.newton_per_goal
    if not math.isfinite(tension):
        for wrong in ((tension, None), (servo.pretension_n, tension)):
            with pytest.raises(RobotError, match=r"FDP \(id 1\) cannot pull"):
                one.request(*wrong)
        assert (one.tension, one.length) == (servo.pretension_n, None)
        return
    assert abs(one.goal_of(tension)) <= servo.most_counts
    assert abs(one.goal_of(tension)) * unit <= servo.most_tension_n * (1 + 1e-8)
    one.request(tension)
    assert servo.pretension_n <= one.tension <= servo.most_tension_n
    wanted = share * servo.most_counts * unit
    assert -1e-6 <= wanted - abs(one.goal_of(wanted)) * unit <= unit * (1 + 1e-6)


@given(length=st.floats(-1.0, 1.0), direction=st.sampled_from((1, -1)))
def test_a_length_is_clipped_to_its_range(length: float, direction: int) -> None:
    """The position winds in by the circumference of the spool per turn, in either direction."""
    ends = {"longest_m": 0.01, "shortest_m": -0.02}
    one = _one(servo("FDP", control="length", direction=direction, **ends))
    one.request(5.0, length)
    kept = min(max(length, -0.02), 0.01)
    turns = -kept / (2 * math.pi * 0.005)
    assert one.goal_position == pytest.approx(direction * turns * 4096, abs=0.6)


_DYNAMIXEL = bytes.fromhex("ffff fdffffff 00f0ffff 00000000 00000000 3200 1f".replace(" ", ""))
_FEETECH = bytes.fromhex("0590 0380 0000 4a 1f 00 00 00 0000 0780".replace(" ", ""))


def test_present_values_are_signed() -> None:
    """A speed of -3 is FD FF FF FF (Dynamixel), or 3 with the top bit set (Feetech).

    A Feetech servo reports position, speed, load, voltage, temperature, two flags, status, and
    last the current.
    """
    seen = _one(servo("FDP", direction=-1)).see(_DYNAMIXEL, 0, pulls=False)
    assert seen["length"] == pytest.approx(-2 * math.pi * 0.005)
    assert seen["speed"] == pytest.approx(-3 * 0.0239808 * 0.005, rel=1e-4)
    assert seen["tension"] == pytest.approx(0.0293, rel=1e-2)
    one = _one(feetech("FDP", direction=-1))
    seen = one.see(_FEETECH, 0, pulls=False)
    assert one.position == -4101
    assert seen["speed"] == pytest.approx(-3 * 0.00153398 * 0.005, rel=1e-4)
    assert seen["tension"] == pytest.approx(7 * 1.018, abs=0.01)
    assert one.fault == ""


def _see(one: TendonServo, mm_per_s: float, now_ms: int, length_mm: float = 0.0) -> str:
    """Return the fault after a cycle with this length and this rate of lengthening."""
    speed = round(-mm_per_s / 5 / DYNAMIXEL.rad_per_s)
    position = round(length_mm * -4096 / (2 * math.pi * 5))
    data = b"\0\0" + speed.to_bytes(4, "little", signed=True)
    data += position.to_bytes(4, "little", signed=True) + bytes(8) + b"\x32\0\x1e"
    one.see(data, now_ms * 1_000_000, pulls=True)
    return one.fault


def test_a_lost_tendon_is_detected() -> None:
    """A tendon is lost after 100 ms above 140 mm/s, or once it is wound in too far."""
    one = _one(servo("FDP"))
    speeds = [(500, 0), (-150, 0), (-150, 99), (-130, 100), (-150, 110), (-150, 209)]
    assert [_see(one, speed, at_ms) for speed, at_ms in speeds] == [""] * 6
    assert "winds in at 150 mm/s" in _see(one, -150, 210)
    assert "wound in by 61 mm" in _see(_one(servo("FDP")), 0, 0, -61)


@pytest.mark.parametrize("name", sorted(MODELS))
@pytest.mark.parametrize("direction", [1, -1])
def test_a_simulated_motor_matches_its_data_sheet(name: str, direction: int) -> None:
    """Without load it has its speed; a blocked tendon has kt i / r, within the friction."""
    model, make = MODELS[name], feetech if name == "STS3215" else servo
    for snapped, amperes in ((True, model.stall_a), (False, 0.4 * model.stall_a)):
        motor = SimulatedMotor(make("FDP", model=name, direction=direction))
        motor.snapped = snapped
        for _ in range(3000 if snapped else 1500):
            motor.advance(direction * amperes, model.volts, 0.0, 1e-3)
        if snapped:
            rpm = abs(motor.speed) * 60 / (2 * math.pi)
            assert rpm == pytest.approx(model.no_load_rpm, rel=0.02)
        else:
            pull, friction = model.torque_constant * amperes / 0.005, model.friction_nm / 0.005
            assert motor.tension == pytest.approx(pull, abs=1.01 * friction)
            assert motor.speed == 0.0
