"""Motors on H-bridges."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.contract.limits import Duty
from shapechanger.errors import RobotError
from tests.robot.drivers.fakes import FakeHardware

_HBRIDGE = {"forward": 22, "backward": 27}
_PHASE = {"phase": 5, "enable": 6}
_values = st.floats(-1.0, 1.0)


@given(value=_values, start=st.floats(0.0, 0.5), full=st.floats(0.6, 1.0))
def test_duty_round_trips_within_a_step(value: float, start: float, full: float) -> None:
    """The motor stops only if its duty rounds to 0 %; gpiozero truncates to whole percents."""
    duty = Duty(start, full)
    done, error = duty.of(value), 0.5 / 100 / (full - start) + 1e-9
    assert duty.size_at(done) == pytest.approx(abs(value), abs=error) or duty.size_at(done) == 0.005
    assert (duty.size_at(done) == 0.0) == (done == 0.0)
    assert done >= start - 0.005 if value else done == 0.0
    assert int(done * 100) == round(done * 100)
    beyond = duty.of(-1.7)
    assert (beyond, duty.size_at(1.0)) == (pytest.approx(full, abs=0.005), 1.0)


@given(values=st.lists(_values, min_size=1, max_size=8))
def test_the_sign_selects_the_pin(values: list[float]) -> None:
    """The pins are never high at the same time."""
    hardware = FakeHardware()
    motor = hardware.output("hbridge", **_HBRIDGE)
    for value in values:
        applied = motor.write(value, 0)
        assert [hardware.factory.pin(pin).state for pin in (22, 27)] == pytest.approx(
            [max(applied, 0.0), max(-applied, 0.0)]
        )
    levels = {"GPIO22": 0.0, "GPIO27": 0.0}
    for pin, level in hardware.factory.log:
        levels[pin] = level
        assert min(levels.values()) == 0.0
    assert [hardware.factory.pin(pin).frequency for pin in (22, 27)] == [50, 50]
    motor.close()


def test_enable_is_on_only_while_the_motor_is_held() -> None:
    """`release` switches the bridge off, and a write switches it on."""
    hardware = FakeHardware()
    motor = hardware.output("hbridge", **_HBRIDGE | {"enable": 24})
    enable = hardware.factory.pin(24)
    assert enable.state == 1.0
    motor.release()
    assert enable.state == 0.0
    motor.write(0.0, 0)
    assert enable.state == 1.0


@pytest.mark.parametrize(("driver", "settings"), [("hbridge", _HBRIDGE), ("phase_enable", _PHASE)])
@pytest.mark.parametrize("value", [1.0, -1.0])
def test_close_leaves_everything_low(driver: str, settings: dict[str, float], value: float) -> None:
    hardware = FakeHardware()
    motor = hardware.output(driver, **settings)
    motor.write(value, 0)
    motor.close()
    motor.close()
    assert set(dict(hardware.factory.log).values()) == {0.0}


@pytest.mark.parametrize(("value", "broken"), [(0.5, 27), (-0.5, 22)])
def test_one_input_goes_low_also_when_the_other_one_fails(value: float, broken: int) -> None:
    hardware = FakeHardware()
    motor = hardware.output("hbridge", **_HBRIDGE)
    motor.write(value, 0)
    hardware.fault.arm(1 if broken == 22 else 2, takes_effect=False)
    with pytest.raises(RobotError, match="timed out"):
        motor.write(0.0, 1)
    assert [hardware.factory.pin(pin).state for pin in (22, 27)] == [0.0, 0.0]


def test_a_pin_in_use_is_refused() -> None:
    hardware = FakeHardware()
    motor = hardware.output("hbridge", **_HBRIDGE)
    with pytest.raises(RobotError, match="GPIO22"):
        hardware.output("hbridge", **_HBRIDGE | {"backward": 23})
    motor.close()


def test_speed_is_zero_while_the_direction_changes() -> None:
    """The enable pin goes low before a change of direction, and only then."""
    hardware = FakeHardware()
    motor = hardware.output("phase_enable", **_PHASE)
    for value in (0.5, 0.6, -0.6, -0.7):
        assert motor.write(value, 0) == pytest.approx(value)
    assert hardware.factory.log == [
        ("GPIO6", 0.5),
        ("GPIO6", 0.6),
        ("GPIO6", 0.0),
        ("GPIO5", 1.0),
        ("GPIO6", 0.6),
        ("GPIO6", 0.7),
    ]
