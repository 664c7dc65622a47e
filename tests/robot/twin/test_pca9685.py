"""Registers of the simulated PCA9685."""

import signal
from pathlib import Path

import pytest
from gpiozero import DigitalOutputDevice

from shapechanger.contract.plan import GuardPlan
from shapechanger.robot.drivers.simulation import PwmChannel
from shapechanger.robot.twin.hardware import connect
from shapechanger.robot.twin.robot import Operator
from shapechanger.robot.twin.signals import read_ledger
from shapechanger.robot.twin.start import start_board
from shapechanger.robot.twin.wiring import TwinWiring
from tests.robot.twin.robots import ACTIONS, process, servo

pytestmark = pytest.mark.realtime

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
    """A PCA9685 pulses without its process; its output-enable pin, pulled up, stops the pulses."""
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
