"""Devices on the twin's pins and chips, from processes that start and die."""

import itertools
import signal
from pathlib import Path

import pytest
from gpiozero import DigitalOutputDevice, Motor, PWMOutputDevice

from shapechanger.contract.plan import GuardPlan
from shapechanger.errors import RobotError
from shapechanger.robot.drivers.simulation import PwmChannel
from shapechanger.robot.twin.hardware import connect
from shapechanger.robot.twin.ledger import TwinWiring, read_ledger
from shapechanger.robot.twin.robot import Operator
from shapechanger.robot.twin.room import DrivingWorld
from shapechanger.robot.twin.start import start_board
from tests.robot.twin.in_process import LocalBoard
from tests.robot.twin.robots import ACTIONS, CAR, process, servo

pytestmark = pytest.mark.realtime

_MOTOR = """
import sys
from gpiozero import Motor, DigitalOutputDevice
from shapechanger.robot.twin.hardware import connect
hardware = connect(sys.argv[1])
factory = hardware.pin_factory()
lamp = DigitalOutputDevice(25, initial_value=True, pin_factory=factory)
motor = Motor(22, 27, pin_factory=factory)
for device in (motor.forward_device, motor.backward_device):
    device.frequency = 50
motor.value = float(sys.argv[2])
print("runs", flush=True)
sys.stdin.read()
hardware.close()
"""


@pytest.mark.parametrize("value", ["1", "0"])
def test_pins_of_a_killed_process_keep_their_level(tmp_path: Path, value: str) -> None:
    with start_board(CAR, "twin", tmp_path) as board, Operator(board.socket_path) as operator:
        with process(_MOTOR, board.socket_path, value) as robot:
            robot.send_signal(signal.SIGKILL)
            robot.wait()
            levels = operator.levels()
        assert levels.duties == {22: float(value), 25: 1.0, 27: 0.0}
        ledger = read_ledger(board.ledger_path)
        gone = [line.kind for line in ledger].index("gone")
        assert ledger[gone].pid == robot.pid
        after = [(line.kind, line.pin, line.hz) for line in ledger[gone + 1 :]]
        assert after == [("pin", 22, 0), ("pin", 25, 0), ("pin", 27, 0)]


def test_a_clean_exit_leaves_motors_low_and_keeps_plain_outputs(tmp_path: Path) -> None:
    """Pins behave as on a Raspberry Pi; the ledger does not report a dead process."""
    with start_board(CAR, "twin", tmp_path) as board, Operator(board.socket_path) as operator:
        with process(_MOTOR, board.socket_path, "0.7") as robot:
            robot.communicate("")
        assert operator.levels().duties == {22: 0.0, 25: 1.0, 27: 0.0}
        assert "gone" not in {line.kind for line in read_ledger(board.ledger_path)}


def test_an_active_low_output_stays_high_when_opened_and_closed(tmp_path: Path) -> None:
    """A low output-enable input of a PCA9685 would enable old pulses."""
    with start_board(CAR, "twin", tmp_path) as board, Operator(board.socket_path) as operator:
        hardware = connect(board.socket_path)
        for _ in range(2):
            device = DigitalOutputDevice(24, active_high=False, pin_factory=hardware.pin_factory())
            assert not device.value
            device.close()
        hardware.close()
        assert operator.levels().duties == {24: 1.0}
        assert {line.duty for line in read_ledger(board.ledger_path) if line.pin == 24} == {1.0}


def test_pwm_of_a_killed_process_keeps_the_level_of_that_moment() -> None:
    """Of all moments of a period, the level is high in one stretch as long as the duty."""
    levels: list[float] = []
    for ms in range(20):  # A period at 50 Hz.
        board = LocalBoard(TwinWiring(CAR), DrivingWorld((), (8, 6), seed=0))
        board.post("claim", 18, "output", "floating", 0)
        board.post("drive", 18, 0.4, 50)
        board.pass_ns(ms * 1_000_000)
        board.post("free", True)
        levels.append(board.pins.levels.duties[18])
    assert (levels.count(1.0), levels.count(0.0)) == (8, 12)
    assert sum(level != before for before, level in itertools.pairwise(levels)) <= 2


def test_pwm_is_rounded_down() -> None:
    """Like gpiozero with lgpio, duty is truncated to whole percent, frequency to whole hertz."""
    board = LocalBoard(TwinWiring(CAR), DrivingWorld((), (8, 6), seed=0))
    device = PWMOutputDevice(18, frequency=50.9, pin_factory=board.hardware.pin_factory())
    for asked, done in ((0.58, 0.57), (0.076, 0.07), (0.5, 0.5), (1.0, 1.0)):
        device.value = asked
        assert board.pins.levels.duties[18] == device.value == done
    assert device.frequency == 50
    board.hardware.close()


def test_a_pin_has_one_owner(tmp_path: Path) -> None:
    with start_board(CAR, "twin", tmp_path) as board:
        second = connect(board.socket_path)
        with (
            process(_MOTOR, board.socket_path, "0.5"),
            pytest.raises(RobotError, match="GPIO22 is busy"),
        ):
            second.pin_factory().pin(22)
        taken_over = DigitalOutputDevice(22, pin_factory=second.pin_factory())
        taken_over.on()
        second.close()


def test_opening_a_pin_releases_it_first(tmp_path: Path) -> None:
    """Opening a pin makes it an input first, so a stuck level falls to its pull-down."""
    with start_board(CAR, "twin", tmp_path) as board, Operator(board.socket_path) as operator:
        with process(_MOTOR, board.socket_path, "1"):
            pass
        assert operator.levels().duties[22] == 1.0
        hardware = connect(board.socket_path)
        Motor(22, 27, pin_factory=hardware.pin_factory())
        assert operator.levels().duties[22] == 0.0
        released = [line for line in read_ledger(board.ledger_path) if line.released]
        assert [line.pin for line in released] == [22, 27]
        hardware.close()


_ON_CHIP = {"over": "pca9685", "bus": 1, "address": 0x40, "channel": 3, "output_enable": 24}
_SERVO_CAR = GuardPlan("car", ACTIONS, (servo("steer", "steering", {"steering": 1.0}, **_ON_CHIP),))

_AWAKE_50_HZ = """
import sys
from shapechanger.robot.twin.hardware import connect
from gpiozero import DigitalOutputDevice
hardware = connect(sys.argv[1])
enable = DigitalOutputDevice(24, initial_value=False, pin_factory=hardware.pin_factory())
bus = hardware.i2c(1)
bus.write_i2c_block_data(0x40, 0xFE, [121])
bus.write_i2c_block_data(0x40, 0x00, [0x21])
bus.write_i2c_block_data(0x40, 0x06 + 4 * 3, [0, 0, 307 & 0xFF, 307 >> 8])
print("pulses", flush=True)
sys.stdin.read()
"""


def test_pulses_continue_after_the_process_dies(tmp_path: Path) -> None:
    """A PCA9685 keeps sending pulses; the pull-up of its output-enable pin ends them."""
    with (
        start_board(_SERVO_CAR, "twin", tmp_path) as board,
        Operator(board.socket_path) as operator,
    ):
        with process(_AWAKE_50_HZ, board.socket_path) as robot:
            robot.send_signal(signal.SIGKILL)
        wiring, levels = TwinWiring(_SERVO_CAR), operator.levels()
        assert levels.channels[PwmChannel(1, 0x40, 3)].us == pytest.approx(1498.16)
        assert wiring.read(levels, 0)["steer"].value == pytest.approx(0.0, abs=0.01)
        lines = [line for line in read_ledger(board.ledger_path) if line.channel == 3]
        assert [(line.us, line.hz) for line in lines] == [(1498.16, 50.029)]

        hardware = connect(board.socket_path)
        enable = DigitalOutputDevice(24, pin_factory=hardware.pin_factory())
        enable.on()
        assert wiring.read(operator.levels(), 0)["steer"].value is None
        with pytest.raises(OSError, match="Remote I/O"):
            hardware.i2c(1).read_i2c_block_data(0x41, 0, 1)
        operator.break_chip(1, 0x40)
        with pytest.raises(OSError, match="Remote I/O"):
            hardware.i2c(1).write_i2c_block_data(0x40, 0, [0])
        hardware.close()
