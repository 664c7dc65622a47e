"""Servos, speed controllers and their pulse sources."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.errors import RobotError
from shapechanger.robot.drivers import pulse
from shapechanger.robot.drivers.pulse import ServoKeys
from tests.robot.drivers.fakes import MS, FakeHardware

_AT = {"over": "lgpio", "pin": 12, "hz": 50}
_ON_CHIP = {"over": "pca9685", "hz": 50}


def _asleep() -> dict[int, int]:
    """Return the registers of a PCA9685 after power-up: asleep, prescale 30."""
    return {0x00: 0x11, 0x01: 0x04, 0xFE: 0x1E}


def _width_us(hardware: FakeHardware, channel: int) -> float:
    low, high = (hardware.bus.chips[0x40][0x06 + 4 * channel + i] for i in (2, 3))
    return (high << 8 | low) * 4.88


@given(value=st.floats(-1.0, 1.0), ends=st.tuples(st.integers(500, 1400), st.integers(1600, 2500)))
def test_width_and_value_are_inverse(value: float, ends: tuple[int, int]) -> None:
    for left, right in (ends, ends[::-1]):
        keys = ServoKeys(over="lgpio", left_us=left, right_us=right)
        assert keys.value(keys.width_us(value)) == pytest.approx(value, abs=1e-9)


def test_servo_gets_no_pulse_before_the_first_write() -> None:
    """A pulse on opening would make the servo jump."""
    hardware = FakeHardware()
    servo = hardware.output("servo", **_AT)
    assert hardware.factory.widths_us == {}
    assert servo.write(-0.5, 0) == -0.5
    assert hardware.factory.widths_us == {12: 1250}
    servo.release()
    assert hardware.factory.widths_us == {12: 0}
    servo.close()


def test_servo_is_limited_in_speed() -> None:
    """A servo turns by 180 degrees from -1 to 1, so 90 degrees per second are 1 per second."""
    servo = FakeHardware().output("servo", **_AT | {"travel_deg_per_s": 90.0})
    assert servo.write(0.0, 0) == 0.0
    assert servo.write(1.0, 100 * MS) == pytest.approx(0.1)
    assert servo.write(-1.0, 300 * MS) == pytest.approx(-0.1)


def test_controller_gets_neutral_until_it_is_armed() -> None:
    """Neutral is sent for `arm_s`, also after a release."""
    hardware = FakeHardware()
    esc = hardware.output("esc", **_AT)
    assert hardware.factory.widths_us == {12: 1500}
    assert esc.write(1.0, 5_000 * MS) == 0.0
    assert esc.write(1.0, 7_499 * MS) == 0.0
    assert hardware.factory.widths_us == {12: 1500}
    assert esc.write(1.0, 7_500 * MS) == 1.0
    assert hardware.factory.widths_us == {12: 2000}
    esc.release()
    assert esc.write(1.0, 8_000 * MS) == 0.0  # The controller needs neutral again.
    esc.close()
    assert hardware.factory.widths_us == {12: 0}


@pytest.mark.parametrize(("reverse", "value", "us"), [("none", 0.0, 1500), ("direct", -1.0, 1000)])
def test_controller_without_a_brake_reverses_at_once_or_never(
    reverse: str, value: float, us: int
) -> None:
    hardware = FakeHardware()
    esc = hardware.output("esc", **_AT | {"reverse": reverse, "arm_s": 0.0})
    assert esc.write(-1.0, 0) == value
    assert hardware.factory.widths_us == {12: us}


def test_controller_brakes_before_it_reverses() -> None:
    """With reverse = "double": brake, neutral, reverse, and again after going forward."""
    hardware = FakeHardware()
    esc = hardware.output("esc", **_AT | {"reverse": "double", "arm_s": 0.0})
    esc.write(1.0, 0)
    sent: list[tuple[float, int]] = []
    for ms in range(0, 600, 100):
        sent.append((esc.write(-0.5, ms * MS), hardware.factory.widths_us[12]))
    assert sent == [(0, 1250), (0, 1250), (0, 1500), (0, 1500), (-0.5, 1250), (-0.5, 1250)]
    assert esc.write(0.0, 700 * MS) == 0.0
    assert esc.write(-0.5, 800 * MS) == -0.5  # The motor has not driven forward since.
    assert esc.write(0.5, 900 * MS) == 0.5
    assert esc.write(-0.5, 1000 * MS) == 0.0
    assert esc.write(0.5, 1050 * MS) == 0.5  # Forward acts at once.


_SETUP = [(0xFD, [0x10]), (0x00, [0x30]), (0xFE, [121])]


@pytest.mark.parametrize(
    ("registers", "first"), [(_asleep(), _SETUP), ({0x00: 0x20, 0xFE: 121}, [])]
)
def test_chip_is_set_up_asleep_and_woken(
    registers: dict[int, int], first: list[tuple[int, list[int]]]
) -> None:
    """A sleeping chip turns all channels off before it wakes; an awake chip need not."""
    hardware = FakeHardware({0x40: registers})
    hardware.output("servo", **_ON_CHIP, channel=3)
    last = [(0x01, [0x04]), (0x00, [0x20]), (0x06 + 12, [0, 0, 0, 0x10])]
    assert [(register, data) for _, register, data in hardware.bus.writes] == first + last


def test_pulse_is_in_whole_steps() -> None:
    hardware = FakeHardware({0x40: _asleep()})
    servo = hardware.output("servo", **_ON_CHIP, channel=15)
    assert servo.write(0.0, 0) == pytest.approx((307 * 4.88 - 1500) / 500)
    assert hardware.bus.writes[-1] == (0x40, 0x06 + 60, [0, 0, 307 & 0xFF, 307 >> 8])
    before = len(hardware.bus.writes)
    servo.write(0.0, 1)
    assert len(hardware.bus.writes) == before  # An unchanged value is not sent again.
    servo.release()
    assert hardware.bus.writes[-1] == (0x40, 0x06 + 60, [0, 0, 0, 0x10])


def test_channels_share_their_chip() -> None:
    hardware = FakeHardware({0x40: _asleep()})
    servos = [hardware.output("servo", **_ON_CHIP, channel=c) for c in range(12)]
    assert sum(register == 0xFE for _, register, _ in hardware.bus.writes) == 1
    with pytest.raises(RobotError, match=r"Channel 3 .* used twice"):
        hardware.output("servo", **_ON_CHIP, channel=3)
    with pytest.raises(RobotError, match="one frequency"):
        hardware.output("servo", **_ON_CHIP | {"hz": 60}, channel=13)
    for servo in servos:
        servo.close()
        servo.close()
    assert hardware.bus.closed == 1
    hardware.output("servo", **_ON_CHIP, channel=3).close()
    assert hardware.bus.closed == 2


def test_output_enable_is_low_only_while_something_is_sent() -> None:
    hardware = FakeHardware({0x40: _asleep()})
    on_chip = _ON_CHIP | {"output_enable": 26}
    one, two = (hardware.output("servo", **on_chip, channel=c) for c in (0, 1))
    enable = hardware.factory.pin(26)
    assert enable.state == 1.0
    one.write(0.0, 0)
    two.write(0.0, 0)
    one.release()
    assert enable.state == 0.0
    two.release()
    assert enable.state == 1.0


def test_outputs_stay_off_while_the_state_of_a_channel_is_unknown() -> None:
    hardware = FakeHardware({0x40: _asleep()})
    on_chip = _ON_CHIP | {"output_enable": 26}
    esc = hardware.output("esc", **on_chip | {"arm_s": 0.0}, channel=0)
    servo = hardware.output("servo", **on_chip, channel=1)
    esc.write(0.0, 0)
    hardware.fault.arm(4, takes_effect=True)
    with pytest.raises(RobotError, match="timed out"):
        esc.write(1.0, 1)
    assert hardware.factory.pin(26).state == 1.0
    servo.write(0.5, 2)
    assert hardware.factory.pin(26).state == 1.0
    esc.write(0.0, 3)
    assert hardware.factory.pin(26).state == 0.0
    assert _width_us(hardware, 0) == pytest.approx(1500, abs=5)


def test_outputs_of_a_dead_process_do_not_come_back() -> None:
    """With an output-enable pin, opening a channel turns off the pulses of all channels."""
    stale = {0x06 + 4 + 2: 410 & 0xFF, 0x06 + 4 + 3: 410 >> 8}  # Channel 1: 2000 us.
    hardware = FakeHardware({0x40: {0x00: 0x20, 0xFE: 121} | stale})
    hardware.output("esc", **_ON_CHIP | {"output_enable": 26}, channel=0)
    assert hardware.factory.pin(26).state == 0.0
    assert (0x40, 0xFD, [0x10]) in hardware.bus.writes


def test_a_chip_that_lost_power_is_configured_again() -> None:
    """The loss is noticed within 100 writes; then writes restore mode, prescaler and pulses."""
    hardware = FakeHardware({0x40: _asleep()})
    esc, servo = (hardware.output("servo", **_ON_CHIP, channel=channel) for channel in (0, 1))
    esc.write(0.0, 0)
    servo.write(0.5, 0)
    hardware.bus.chips[0x40] = _asleep()
    with pytest.raises(RobotError, match="lost power"):
        list(map(esc.write, [0.0] * 100, range(100)))
    esc.write(0.0, 100)
    servo.write(0.5, 100)
    chip = hardware.bus.chips[0x40]
    assert (chip[0x00], chip[0xFE]) == (0x20, 121)
    assert _width_us(hardware, 0) == pytest.approx(1500, abs=5)
    assert _width_us(hardware, 1) == pytest.approx(1750, abs=5)


_KERNEL = {"over": "sysfs", "channel": 1, "hz": 50}


def test_kernel_pwm_is_written_in_nanoseconds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pulse, "_ROOT", tmp_path)
    folder = tmp_path / "pwmchip0" / "pwm1"
    folder.mkdir(parents=True)
    servo = FakeHardware().output("servo", **_KERNEL)
    assert servo.write(0.0008, 0) == 0.0

    def files() -> dict[str, int]:
        return {file.name: int(file.read_text()) for file in folder.iterdir()}

    assert files() == {"period": 20_000_000, "duty_cycle": 1_500_000, "enable": 1}
    servo.close()
    assert files() == {"period": 20_000_000, "duty_cycle": 0, "enable": 0}


def test_a_missing_kernel_pwm_is_named() -> None:
    with pytest.raises(RobotError, match=r"'it' does not answer: .*pwmchip77"):
        FakeHardware().output("servo", **_KERNEL, chip=77)
