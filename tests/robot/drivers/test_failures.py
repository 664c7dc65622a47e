"""Output drivers recover from a single hardware failure with the next write."""

import contextlib
from collections.abc import Callable, Iterator
from itertools import chain
from pathlib import Path
from typing import Any

import pytest

from shapechanger.errors import RobotError
from shapechanger.robot.drivers import pulse
from shapechanger.robot.drivers.chip import OUTPUTS, OutputDriver
from shapechanger.robot.drivers.pulse import SysfsPwm
from tests.robot.drivers.fakes import FakeHardware

_OVER = {
    "pca9685": {"over": "pca9685", "channel": 2},
    "pca9685 with OE": {"over": "pca9685", "channel": 2, "output_enable": 26},
    "lgpio": {"over": "lgpio", "pin": 12},
    "sysfs": {"over": "sysfs", "chip": 0, "channel": 1},
}
_OUTPUTS: dict[str, tuple[str, dict[str, Any]]] = {
    "hbridge": ("hbridge", {"forward": 22, "backward": 27}),
    "hbridge with enable": ("hbridge", {"forward": 22, "backward": 27, "enable": 24}),
    "phase_enable": ("phase_enable", {"phase": 5, "enable": 6}),
    **{f"servo over {over}": ("servo", {"hz": 50} | at) for over, at in _OVER.items()},
    **{f"esc over {over}": ("esc", {"hz": 50, "arm_s": 0.0} | at) for over, at in _OVER.items()},
}
_MOST_OPERATIONS = 100


class _Bench:
    def __init__(self, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.driver, self.settings = _OUTPUTS[name]
        self.hardware = FakeHardware({0x40: {0x00: 0x11, 0x01: 0x04, 0xFE: 0x1E}})
        self._folder = tmp_path / "pwmchip0" / "pwm1"
        self._folder.mkdir(parents=True, exist_ok=True)
        fault = self.hardware.fault

        write = SysfsPwm._write

        def faulty_write(pwm: SysfsPwm, file: str, number: int) -> None:
            fault.during(lambda: write(pwm, file, number))

        monkeypatch.setattr(pulse, "_ROOT", tmp_path)
        monkeypatch.setattr(SysfsPwm, "_write", faulty_write)

    def open(self) -> OutputDriver:
        return self.hardware.output(self.driver, **self.settings)

    @contextlib.contextmanager
    def failing(self, operation: int, takes_effect: bool) -> Iterator[None]:
        """Make operation number `operation` fail; suppress the error."""
        self.hardware.fault.arm(operation, takes_effect)
        with contextlib.suppress(RobotError):
            yield
        self.hardware.fault.disarm()

    def state(self) -> dict[str, Any]:
        """Return the levels and pulses at the motor."""
        chip = self.hardware.bus.chips[0x40]
        pins = {
            pin.info.name: float(pin.state)
            for pin in self.hardware.factory.pins.values()
            if pin.function == "output"
        }
        if not pins.get("GPIO6"):
            pins.pop("GPIO5", None)  # Without a speed the direction has no effect.
        return {
            "pins": pins,
            "pulses": {pin: us for pin, us in self.hardware.factory.widths_us.items() if us},
            "channel": [chip.get(register, 0) for register in range(0x06 + 8, 0x06 + 12)],
            "asleep": chip[0x00] & 0x10,
            "kernel": {file.name: file.read_text() for file in self._folder.iterdir()},
        }


Bench = Callable[[], _Bench]


@pytest.fixture(params=_OUTPUTS)
def bench(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bench:
    """Make a bench for each output driver, over each way of sending pulses."""
    made = iter(range(10 * _MOST_OPERATIONS))
    return lambda: _Bench(request.param, tmp_path / str(next(made)), monkeypatch)


def _state_after(bench: Bench, *values: float) -> dict[str, Any]:
    sound = bench()
    output = sound.open()
    for i, value in enumerate(values):
        output.write(value, i)
    return sound.state()


def _benches(bench: Bench) -> Iterator[tuple[int, _Bench]]:
    """Make benches, each with a number, until every operation has failed once."""
    for operation in range(1, _MOST_OPERATIONS):
        tried = bench()
        yield operation, tried
        if not tried.hardware.fault.happened:
            return


# Drivers that `servos/test_faults.py` covers.
_ON_A_BUS = {"bus_servo"}


def test_every_driver_is_covered() -> None:
    assert {driver for driver, _ in _OUTPUTS.values()} == set(OUTPUTS) - _ON_A_BUS


_takes_effect = pytest.mark.parametrize("takes_effect", [False, True])


@_takes_effect
@pytest.mark.parametrize(("before", "asked"), [(0.0, 0.6), (0.6, -0.6), (-0.6, 0.0), (0.3, 0.6)])
def test_after_a_failure_the_next_write_reaches_the_hardware(
    bench: Bench, before: float, asked: float, takes_effect: bool
) -> None:
    for after in (0.0, before, asked):
        expected = _state_after(bench, before, after)
        for operation, tried in _benches(bench):
            output = tried.open()
            output.write(before, 0)
            with tried.failing(operation, takes_effect):
                output.write(asked, 1)
                assert not tried.hardware.fault.happened, "a failure was hidden"
            output.write(after, 2)
            assert tried.state() == expected, (operation, after)


@_takes_effect
def test_after_a_failed_release_the_next_one_reaches_the_hardware(
    bench: Bench, takes_effect: bool
) -> None:
    expected: list[dict[str, Any]] = []
    for operation, tried in chain([(0, bench())], _benches(bench)):  # No operation has number 0.
        output = tried.open()
        output.write(0.6, 0)
        with tried.failing(operation, takes_effect):
            output.release()
        output.release()
        states = [tried.state()]
        output.write(0.0, 1)
        states.append(tried.state())
        expected = expected or states
        assert states == expected, operation


@_takes_effect
def test_after_a_failed_opening_it_can_be_opened(bench: Bench, takes_effect: bool) -> None:
    """The supervisor can retry opening with the same pins."""
    expected = _state_after(bench)
    for operation, tried in _benches(bench):
        output = None
        with tried.failing(operation, takes_effect):
            output = tried.open()
        output = output or tried.open()
        assert tried.state() == expected, operation
        output.close()


@_takes_effect
def test_after_a_failed_close_it_can_be_opened(bench: Bench, takes_effect: bool) -> None:
    """A driver whose close failed holds no pin, and the next one brings the output to rest."""
    expected = _state_after(bench, 0.0)
    for operation, tried in _benches(bench):
        output = tried.open()
        output.write(0.6, 0)
        with tried.failing(operation, takes_effect):
            output.close()
        tried.open().write(0.0, 1)
        assert tried.state() == expected, operation
