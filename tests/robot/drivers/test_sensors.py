"""Sensor drivers, tested with fake pins and registers."""

import math
import struct
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.errors import RobotError
from tests.robot.drivers.fakes import MS, FakeHardware

_ENCODER = {"a": 5, "counts_per_turn": 20, "wheel_m": 0.2}
_QUADRATURE = _ENCODER | {"b": 6}
_SONAR = {"trigger": 23, "echo": 24}


def _turn(hardware: FakeHardware, backward: bool, turns: int, period_s: float) -> float:
    """Turn a quadrature encoder, starting and ending with both channels high; a leads forward."""
    edges = [(5, 0), (6, 0), (5, 1), (6, 1)]
    if backward:
        edges = [(6, 0), (5, 0), (6, 1), (5, 1)]
    now_s = 0.0
    for _ in range(turns):
        for pin, level in edges:
            now_s += period_s / 4
            hardware.factory.drive(pin, level, now_s)
    return now_s


@given(speed=st.floats(0.05, 5.0), counts=st.integers(2, 30), backward=st.booleans())
def test_quadrature_gives_speed_and_direction(speed: float, counts: int, backward: bool) -> None:
    """One count is 10 mm; the speed is exact at any edge rate."""
    hardware = FakeHardware()
    encoder = hardware.sensor("encoder", **_QUADRATURE)
    now_s = _turn(hardware, backward, counts, 0.01 / speed)
    expected = -speed if backward else speed
    assert encoder.read(round(now_s * 1e9), -1.0)["speed"] == pytest.approx(expected)
    encoder.close()


def test_one_channel_has_the_sign_of_the_propulsion() -> None:
    hardware = FakeHardware()
    encoder = hardware.sensor("encoder", **_ENCODER)
    for i in range(6):
        hardware.factory.drive(5, i % 2, 0.01 * i)
    for propulsion, speed in ((-1.0, -0.5), (0.0, -0.5), (1.0, 0.5)):
        assert encoder.read(50 * MS, propulsion)["speed"] == pytest.approx(speed)


def test_wheel_without_edges_slows_to_zero() -> None:
    hardware = FakeHardware()
    encoder = hardware.sensor("encoder", **_QUADRATURE)
    assert encoder.read(0, 0.0) == {"speed": 0.0}
    now_ns = round(_turn(hardware, False, 2, 0.02) * 1e9)
    for ms, speed in ((0, 0.5), (100, 0.025), (501, 0.0)):
        assert encoder.read(now_ns + ms * MS, 1.0)["speed"] == pytest.approx(speed)


@pytest.mark.parametrize(("pull", "pressed"), [("up", 0), ("down", 1)])
def test_a_press_is_reported_even_if_it_is_short(pull: str, pressed: int) -> None:
    hardware = FakeHardware()
    bumper = hardware.sensor("switch", pins=[6, 13], pull=pull)
    assert bumper.read(0, 1.0) == {"bump": 0.0}
    hardware.factory.drive(13, pressed, 0.1)
    hardware.factory.drive(13, 1 - pressed, 0.101)
    assert [bumper.read(0, 1.0)["bump"] for _ in range(2)] == [1.0, 0.0]
    hardware.factory.drive(6, pressed, 0.2)
    assert [bumper.read(0, 1.0)["bump"] for _ in range(3)] == [1.0, 1.0, 1.0]
    bumper.close()


def _echo(hardware: FakeHardware, seconds: float) -> None:
    hardware.factory.drive(24, 1, 1.0)
    hardware.factory.drive(24, 0, 1.0 + seconds)


def test_an_echo_gives_the_distance_and_pings_are_60_ms_apart() -> None:
    """With shorter intervals, a ping could receive the echo of the previous one."""
    hardware = FakeHardware()
    sonar = hardware.sensor("hcsr04", **_SONAR)
    pings: list[int] = []
    for ms in range(0, 180, 10):
        before = len(hardware.factory.log)
        seen = sonar.read(ms * MS, 1.0)
        assert seen == ({"distance": pytest.approx(0.5)} if pings else {})
        if len(hardware.factory.log) > before:
            pings.append(ms)
            _echo(hardware, 2 * 0.5 / 343.2)
    assert pings == [0, 60, 120]
    assert hardware.factory.log[:2] == [("GPIO23", 1.0), ("GPIO23", 0.0)]
    _echo(hardware, 0.038)  # The sensor's pulse if there is no echo.
    assert sonar.read(180 * MS, 1.0)["distance"] == 2.0
    sonar.close()


@pytest.mark.parametrize("is_real", [True, False])
def test_a_ping_never_sleeps(monkeypatch: pytest.MonkeyPatch, is_real: bool) -> None:
    """The trigger stays high for 10 us by busy waiting, and on simulated pins for no time."""
    hardware = FakeHardware()
    monkeypatch.setattr(hardware, "clock", SimpleNamespace(is_real=is_real))
    sonar = hardware.sensor("hcsr04", **_SONAR)
    times: list[int] = []
    real_ns = time.perf_counter_ns
    with monkeypatch.context() as patch:
        patch.setattr(time, "sleep", None)
        patch.setattr(time, "perf_counter_ns", lambda: times.append(real_ns()) or times[-1])
        assert sonar.read(0, 1.0) == {}
    assert times[-1] - times[0] >= 10_000 if is_real else not times
    assert hardware.factory.log == [("GPIO23", 1.0), ("GPIO23", 0.0)]


@pytest.mark.parametrize(("rises", "seen"), [(False, {"distance": 1.8876}), (True, {})])
def test_sonar_fails_after_three_missed_echoes_and_comes_back(
    rises: bool, seen: dict[str, float]
) -> None:
    """Until it fails, it reports the last distance; an echo line that stays high is no echo."""
    hardware = FakeHardware()
    sonar = hardware.sensor("hcsr04", **_SONAR)
    sonar.read(0, 1.0)
    if rises:
        hardware.factory.drive(24, 1, 0.0)
    else:
        _echo(hardware, 0.011)
    for ms in range(10, 240, 10):
        assert sonar.read(ms * MS, 1.0) == pytest.approx(seen)
    for ms in (240, 250, 300, 1000):
        with pytest.raises(RobotError, match="no echo"):
            sonar.read(ms * MS, 1.0)
    _echo(hardware, 0.002)
    if not rises:
        assert sonar.read(1010 * MS, 1.0)["distance"] == pytest.approx(0.3432)


def _motion(x: int, y: int, z: int, yaw: int) -> dict[int, int]:
    data = struct.pack(">7h", x, y, z, 0, 0, 0, yaw)
    return {0x75: 0x68} | {0x3B + i: byte for i, byte in enumerate(data)}


@pytest.mark.parametrize("counts", [-32768, -1, 1, 4096, 32767])
def test_motion_is_in_si_units_over_the_whole_range(counts: int) -> None:
    """Full scale is 4 g and 500 deg/s; readings are in m/s^2 and rad/s."""
    hardware = FakeHardware({0x69: _motion(counts, -1 - counts, 8192, counts)})
    imu = hardware.sensor("mpu6050", address=0x69)
    read = imu.read(0, 1.0)
    assert read["acceleration_x"] == pytest.approx(counts / 8192 * 9.80665)
    assert read["acceleration_y"] == pytest.approx((-1 - counts) / 8192 * 9.80665)
    assert read["yaw_rate"] == pytest.approx(math.radians(counts / 65.5))
    chip = hardware.bus.chips[0x69]
    assert [chip[register] for register in (0x6B, 0x1A, 0x1B, 0x1C)] == [1, 3, 8, 8]
    imu.close()


@given(counts=st.integers(-32768, 32767))
def test_gyroscope_learns_its_zero_while_the_robot_rests(counts: int) -> None:
    """The first reading at rest is the bias, if it is below 25 deg/s; later ones move it by 2 %."""
    hardware = FakeHardware({0x68: _motion(0, 0, 8192, counts)})
    imu, rate = hardware.sensor("mpu6050"), math.radians(counts / 65.5)
    bias = rate if abs(counts) / 65.5 < 25.0 else 0.0
    assert imu.read(0, 0.0)["yaw_rate"] == pytest.approx(rate - bias, abs=1e-12)
    hardware.bus.chips[0x68] |= _motion(0, 0, 8192, 655)
    moved = math.radians(10.0)
    assert imu.read(0, 1.0)["yaw_rate"] == pytest.approx(moved - bias)
    if bias:
        assert imu.read(0, 0.0)["yaw_rate"] == pytest.approx(0.98 * (moved - bias), abs=1e-12)
    # After a loss of power all readings are 0, including gravity.
    hardware.bus.chips[0x68] |= _motion(0, 0, 0, 0)
    with pytest.raises(RobotError, match="lost power"):
        imu.read(0, 0.0)


@pytest.mark.parametrize(
    ("driver", "chips", "text"),
    [
        ("mpu6050", {0x68: {0x75: 0x71}}, "identifies itself as 0x71, not 0x68"),
        ("mpu6050", {}, "0x68 on I2C bus 1 does not answer"),
        ("ina219", {}, "'it' at 0x40 on I2C bus 1 does not answer"),
    ],
)
def test_a_wrong_or_missing_chip_is_named(
    driver: str, chips: dict[int, dict[int, int]], text: str
) -> None:
    with pytest.raises(RobotError, match=text):
        FakeHardware(chips).sensor(driver)


def test_battery_is_in_volts() -> None:
    """The voltage has 4 mV steps above three status bits, and is read at most every 100 ms."""
    hardware = FakeHardware({0x41: {0x02: (1850 << 3 | 2) >> 8, 0x03: (1850 << 3 | 2) & 0xFF}})
    battery = hardware.sensor("ina219", address=0x41)
    assert battery.read(0, 0.0)["battery"] == pytest.approx(7.4)
    del hardware.bus.chips[0x41]
    assert battery.read(99 * MS, 0.0)["battery"] == pytest.approx(7.4)
    with pytest.raises(RobotError, match="does not answer"):
        battery.read(100 * MS, 0.0)
    battery.close()


def test_temperature_is_in_degrees(tmp_path: Path) -> None:
    """The kernel reports thousandths of a degree; the file is read once a second."""
    file = tmp_path / "temp"
    file.write_text("48312\n")
    sensor = FakeHardware().sensor("cpu_temperature", path=str(file))
    assert sensor.read(0, 0.0) == {"temperature": 48.312}
    file.write_text("hot")
    assert sensor.read(999 * MS, 0.0) == {"temperature": 48.312}
    with pytest.raises(RobotError, match=r"'hot' at .* is no temp"):
        sensor.read(1000 * MS, 0.0)
    with pytest.raises(RobotError, match="does not answer"):
        FakeHardware().sensor("cpu_temperature", path=str(tmp_path / "none"))
    sensor.close()
