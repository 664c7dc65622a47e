"""Servo instructions sent over a board's socket to servos in another process."""

from collections.abc import Iterator
from dataclasses import replace

import pytest

from shapechanger.errors import RobotError
from shapechanger.finger.parameters import NOMINAL
from shapechanger.finger.twin import finger_place
from shapechanger.robot.guard.outputs import OutputBank, make_safe
from shapechanger.robot.guard.sensors import Sensors
from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.robot.twin.hardware import TwinHardware, connect
from shapechanger.robot.twin.robot import Operator
from shapechanger.robot.twin.start import BoardAt, start_board

pytestmark = pytest.mark.realtime

_PLAN = load_profile(find_profile("finger")).guard_plan()
_PULL = (0.5, *(0.0,) * 6)


@pytest.fixture(scope="module")
def board(tmp_path_factory: pytest.TempPathFactory) -> Iterator[BoardAt]:
    place = finger_place(NOMINAL)
    with start_board(_PLAN, "twin", tmp_path_factory.mktemp("board"), place=place) as started:
        yield started


@pytest.fixture
def hardware(board: BoardAt) -> Iterator[TwinHardware]:
    made = connect(board.socket_path)
    yield made
    made.close()


def test_outputs_set_tensions_that_the_sensors_report(
    board: BoardAt, hardware: TwinHardware
) -> None:
    """Sensors read the commanded tensions; a servo's fault is reported as a failure."""
    outputs, sensors = OutputBank(_PLAN, hardware), Sensors(_PLAN, hardware)
    with Operator(board.socket_path) as operator:
        for _ in range(20):
            outputs.write(_PULL, hardware.clock.now_ns())
            reading = sensors.read(operator.advance(0.01), 0.0)
        assert reading.failures == {}
        assert reading.quantities["FDP/tension"] == pytest.approx(8.0, abs=0.1)
        assert operator.tensions()["FDP"] == pytest.approx(8.0, abs=1.5)  # Friction of gears.
        outputs.release()
        operator.advance(0.3)
        assert operator.tensions()["FDP"] < 1.5
        operator.break_servo("PI", "deaf")
        operator.break_magnet("PIP_flexion")
        failures = [sensors.read(operator.advance(0.01), 0.0).failures for _ in range(8)][-1]
        assert "Servo PI (id 7) does not answer" in failures["tendons"]
        assert "PIP_flexion, on channel 2, detects no magnet" in failures["joints"]
        operator.break_servo("PI", "")
        operator.break_magnet("PIP_flexion", "")
    sensors.close()
    assert outputs.close(0) == []


def test_make_safe_sends_nothing_to_servos(board: BoardAt, hardware: TwinHardware) -> None:
    """Without packets, the watchdogs of the servos expire."""
    outputs = OutputBank(_PLAN, hardware)
    with Operator(board.socket_path) as operator:
        for _ in range(10):
            outputs.write(_PULL, hardware.clock.now_ns())
            operator.advance(0.01)
        assert make_safe(_PLAN, hardware) == []
        assert operator.tensions()["FDP"] > 4.0
        operator.advance(0.5)
        assert max(operator.tensions().values()) < 1.5
    outputs.close(0)


def test_an_unknown_bus_device_is_refused(hardware: TwinHardware) -> None:
    outputs = tuple(
        replace(one, settings={**one.settings, "device": "/dev/ttyUSB7"}) for one in _PLAN.outputs
    )
    with pytest.raises(RobotError, match="There is no /dev/ttyUSB7 at this twin"):
        OutputBank(replace(_PLAN, outputs=outputs), hardware)
