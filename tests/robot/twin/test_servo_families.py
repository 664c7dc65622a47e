"""Rig of a finger: real guard and drivers on a twin, with servos of each family."""

import contextlib
import re
from collections.abc import Iterator

import pytest

from shapechanger.errors import RobotError
from shapechanger.finger.parameters import NOMINAL
from shapechanger.finger.twin import FingerWorld
from shapechanger.layout import Layout
from shapechanger.robot.drivers.as5600 import SimulatedJoints
from shapechanger.robot.guard.channel import Order
from shapechanger.robot.guard.outputs import Switches, make_safe
from shapechanger.robot.link.messages import Observation
from shapechanger.robot.profile import Profile
from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.robot.twin.ledger import TwinWiring
from tests.robot.profile.texts import finger_text, read
from tests.robot.twin.in_process import InProcessRobot, LocalBoard

_REST = (0.0,) * 7
_FLEX = (0.65, 0.65, 0.2, 0.2, 0.2, 0.2, 0.2)
_BENT = (0.65, 0.65, 0.0, 0.0, 0.0, 0.0, 0.0)
_TICK_NS = 10_000_000


class _Bench:
    def __init__(self, profile: Profile) -> None:
        self.robot = InProcessRobot(profile, FingerWorld(NOMINAL, seed=3))
        self.names = Layout.from_json(self.robot.welcome.state_layout).names
        self.seen = self.robot.start()
        self.rig = self.robot.pins.require_rig()

    def drive(self, values: tuple[float, ...], steps: int) -> Observation:
        for _ in range(steps):
            self.seen, _ = self.robot.step(values)
        return self.seen

    def state(self, name: str) -> float:
        return self.seen.state[self.names.index(name)]

    def pulls(self) -> list[float]:
        return [servo.pulls_a for servo in self.rig.servos.values()]

    def advance_without_guard(self, ms: int) -> None:
        now_ns = self.robot.now_ns
        for i in range(1, ms // 10 + 1):
            self.robot.pins.advance(now_ns + i * _TICK_NS)


@pytest.fixture(params=["Dynamixel", "Feetech"])
def family(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture
def bench(family: str) -> Iterator[_Bench]:
    made = _Bench(read(finger_text(family)))
    yield made
    made.robot.close()


@pytest.fixture
def tensed() -> Iterator[_Bench]:
    """The armed rig of the shipped finger, whose commands are tensions."""
    made = _Bench(load_profile(find_profile("finger")))
    yield made
    made.robot.close()


def test_commands_move_the_finger(bench: _Bench, family: str) -> None:
    """No servo has torque before the first command; at 0, each pulls with its pretension."""
    assert bench.seen.armed
    assert not any(servo.has_torque for servo in bench.rig.servos.values())
    bench.drive(_FLEX, 100)
    assert bench.seen.stop_reason == ""
    assert bench.state("FDP/length") < -0.008
    assert bench.state("FDS/length") < -0.005
    assert bench.seen.action_applied == pytest.approx(_FLEX)
    model = bench.rig.servo("FDP").motor._model
    most, pretension = (15.0, 1.0) if family == "Dynamixel" else (25.0, 6.0)
    assert max(bench.rig.tensions().values()) < most + 2.0 * model.friction_nm / 0.010
    bench.drive(_REST, 25)
    goals = [abs(a) * model.torque_constant / 0.010 for a in bench.pulls()]
    assert goals == pytest.approx([pretension] * 7, abs=model.ampere_per_goal * 100)


def test_an_emergency_stop_ends_without_torque(bench: _Bench) -> None:
    """Tensions fall to the pretension first; 0.4 s after the stop, no servo has torque."""
    bench.drive(_FLEX, 25)
    assert min(bench.pulls()) > 0.0
    bench.robot._orders.waiting.append(Order("emergency", issued_ns=bench.robot.now_ns))
    bench.robot._advance(40 * _TICK_NS)
    assert bench.pulls() == [0.0] * 7
    assert not any(servo.has_torque for servo in bench.rig.servos.values())


def test_servos_are_limp_after_the_death_of_the_guard(bench: _Bench, family: str) -> None:
    """Dynamixel servos are stopped by their watchdogs; Feetech servos lose their power."""
    bench.drive(_FLEX, 25)
    bench.advance_without_guard(80)
    assert min(bench.pulls()) > 0.0
    bench.advance_without_guard(150)
    assert bench.pulls() == [0.0] * 7
    assert max(abs(servo.motor.current) for servo in bench.rig.servos.values()) == 0.0
    assert bench.rig.has_power == (family == "Dynamixel")


@pytest.mark.parametrize(
    ("how", "text"),
    [
        ("deaf", "FDS .*does not answer"),
        ("overload", "FDS .*overloaded"),
        ("power", "FDS .*(restarted|does not answer)"),
    ],
)
def test_a_failed_servo_stops_all(bench: _Bench, family: str, how: str, text: str) -> None:
    """All servos, also one that gets no packets, stay released until a person arms the robot."""
    bench.drive(_FLEX, 25)
    bench.rig.break_servo("FDS", how)
    bench.drive(_FLEX, 80)
    assert re.search(text, bench.seen.stop_reason), bench.seen.stop_reason
    assert bench.pulls() == [0.0] * 7
    refused = "FDS .*overloaded. Only a reboot" if how == "overload" else ""
    if not refused:
        bench.rig.break_servo("FDS", "")
        bench.drive(_FLEX, 20)
        assert bench.seen.stop_reason != ""
    if how == "power" and family == "Dynamixel":
        refused = "FDS lost the power, and so the zero"
    if refused:
        with pytest.raises(RobotError, match=refused):
            bench.robot.arm()
    else:
        bench.robot.arm()
        bench.drive(_FLEX, 40)
        assert bench.seen.stop_reason == ""
        assert min(bench.pulls()) > 0.0


def test_arming_does_not_keep_a_deaf_servo_pulling(bench: _Bench) -> None:
    """Repeated attempts to arm must not keep the servo's power on."""
    bench.drive(_FLEX, 25)
    bench.rig.break_servo("FDS", "deaf")
    for _ in range(10):
        bench.drive(_FLEX, 1)
        with contextlib.suppress(RobotError):
            bench.robot.arm()
    assert bench.pulls() == [0.0] * 7
    with pytest.raises(RobotError, match="FDS"):
        bench.robot.arm()
    bench.rig.break_servo("FDS", "")
    bench.drive(_FLEX, 40)
    bench.robot.arm()
    bench.drive(_FLEX, 5)
    assert bench.seen.stop_reason == ""


def test_safe_pins_cut_the_power_of_feetech_servos() -> None:
    """After a crash, `make_safe` sets the enable line low, and sends no packets to servos."""
    plan = read(finger_text("Feetech")).guard_plan()
    board = LocalBoard(TwinWiring(plan), FingerWorld(NOMINAL, seed=3))
    switches = Switches(plan, board.hardware)
    bus = board.pins.require_rig()
    for _ in range(50):
        switches.toggle()
        board.pass_ns(_TICK_NS)
    bus.write({1: b"\1"}, 40)
    assert bus.servos[1].has_torque
    switches.close()
    assert make_safe(plan, board.hardware) == []
    board.pass_ns(11 * _TICK_NS)
    assert not bus.has_power
    assert not bus.servos[1].has_torque


def test_a_missing_magnet_releases_all_tendons(tensed: _Bench) -> None:
    """Tendons go to the pretension, then to zero, and stay released until a person has armed."""
    tensed.drive(_BENT, 25)
    (joints,) = tensed.robot.pins.of_kind(SimulatedJoints)
    joints.set_magnet("PIP_flexion", "gone")
    tensed.drive(_BENT, 2)
    assert tensed.seen.stop_reason == ""  # After a short loss, only the joint's reading is absent.
    assert tensed.seen.sources["PIP_flexion/angle"] == "absent"
    tensed.drive(_BENT, 2)
    assert "The encoder of PIP_flexion, on channel 2, detects no magnet." in tensed.seen.stop_reason
    assert not tensed.seen.armed
    tensed.drive(_BENT, 36)
    assert tensed.pulls() == [0.0] * 7
    joints.set_magnet("PIP_flexion", "")
    tensed.drive(_BENT, 5)
    assert "no magnet" in tensed.seen.stop_reason
    tensed.robot.arm()
    tensed.drive(_BENT, 20)
    assert tensed.seen.stop_reason == ""
