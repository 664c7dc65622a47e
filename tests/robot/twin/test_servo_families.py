"""One exam for both families of servos on a bus: the real guard and drivers on a twin."""

from __future__ import annotations

import contextlib
import re
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from shapechanger.errors import ProfileError, RobotError
from shapechanger.finger.anatomy import JOINTS, MOMENT_ARMS, TENDONS
from shapechanger.finger.parameters import NOMINAL
from shapechanger.finger.twin import FingerWorld, finger_place
from shapechanger.layout import Layout
from shapechanger.robot.drivers.servos.simulation import Rig
from shapechanger.robot.guard import start
from shapechanger.robot.guard.channel import GuardState, Order, decode_state, encode
from shapechanger.robot.guard.outputs import Switches, make_safe
from shapechanger.robot.guard.running import ServePlan, plan_fd
from shapechanger.robot.link.messages import Observation
from shapechanger.robot.profile import Profile
from shapechanger.robot.setup.calibration import find_zeros
from shapechanger.robot.twin.robot import Operator
from shapechanger.robot.twin.start import start_board
from shapechanger.robot.twin.wiring import TwinWiring
from tests.robot.profile.texts import finger_text, read
from tests.robot.twin.in_process import InProcessRobot, LocalBoard
from tests.robot.twin.robots import until

_REST = (0.0,) * 7
_FLEX = (0.65, 0.65, 0.2, 0.2, 0.2, 0.2, 0.2)
_ALL = (1.0,) * 7
_TICK_NS = 10_000_000


class _Bench:
    """An armed rig, whose twin may be wired with other servos."""

    def __init__(self, family: str, wired_as: Profile | None = None) -> None:
        self.family = family
        self.profile = read(finger_text(family))
        plan = None if wired_as is None else wired_as.guard_plan()
        self.robot = InProcessRobot(self.profile, FingerWorld(NOMINAL, seed=3), wired_as=plan)
        self.names = Layout.from_json(self.robot.welcome.state_layout).names
        self.seen = self.robot.start()

    @property
    def rig(self) -> Rig:
        return self.robot.pins.require_rig()

    def drive(self, values: tuple[float, ...], steps: int) -> Observation:
        for _ in range(steps):
            self.seen, _ = self.robot.step(values)
        return self.seen

    def length(self, name: str) -> float:
        return self.seen.state[self.names.index(f"{name}/length")]

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
    """An armed rig of each family."""
    made = _Bench(family)
    yield made
    made.robot.close()


def test_no_servo_pulls_before_the_first_command(bench: _Bench) -> None:
    """An armed rig enables no torque without a command."""
    assert bench.seen.armed
    assert not any(servo.has_torque for servo in bench.rig.servos.values())


def test_commands_move_the_finger(bench: _Bench) -> None:
    """Flexors go to their lengths, with at most their largest tension."""
    bench.drive(_FLEX, 100)
    assert bench.seen.stop_reason == ""
    assert bench.length("FDP") < -0.008
    assert bench.length("FDS") < -0.005
    assert bench.seen.action_applied == pytest.approx(_FLEX)
    friction = bench.rig.servo("FDP").motor._model.gears.friction_nm / 0.010
    most = 15.0 if bench.family == "Dynamixel" else 25.0
    assert max(bench.rig.tensions().values()) < most + 2.0 * friction


def test_rest_is_the_pretension(bench: _Bench) -> None:
    """At the command 0 each servo pulls with its pretension, to one count of its goal."""
    bench.drive(_FLEX, 25)
    bench.drive(_REST, 25)
    pretension = 1.0 if bench.family == "Dynamixel" else 6.0
    model = bench.rig.servo("FDP").motor._model
    goals = [abs(a) * model.torque_constant / 0.010 for a in bench.pulls()]
    assert goals == pytest.approx([pretension] * 7, abs=model.ampere_per_goal * 100)


def test_an_emergency_stop_ends_without_torque(bench: _Bench) -> None:
    """The tensions fall to the pretension in 0.3 s, and then no servo has torque."""
    bench.drive(_FLEX, 25)
    assert min(bench.pulls()) > 0.0
    bench.robot._orders.waiting.append(Order("emergency", issued_ns=bench.robot.now_ns))
    bench.robot._advance(40 * _TICK_NS)
    assert bench.pulls() == [0.0] * 7
    assert not any(servo.has_torque for servo in bench.rig.servos.values())


def test_servos_are_limp_after_the_death_of_the_guard(bench: _Bench) -> None:
    """Watchdogs of Dynamixel servos stop them; Feetech servos lose their power."""
    bench.drive(_FLEX, 25)
    bench.advance_without_guard(80)
    assert min(bench.pulls()) > 0.0
    bench.advance_without_guard(150)
    assert bench.pulls() == [0.0] * 7
    assert max(abs(servo.motor.current) for servo in bench.rig.servos.values()) == 0.0
    assert bench.rig.has_power == (bench.family == "Dynamixel")


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ("mute", "FDS .*does not answer"),
        ("deaf", "FDS .*does not answer"),
        ("hot", "FDS .*(overheated|more than 65 C)"),
        ("overload", "FDS .*overloaded"),
        ("power", "FDS .*(restarted|does not answer)"),
    ],
)
def test_a_failed_servo_stops_all(bench: _Bench, how: str, words: str) -> None:
    """All servos let go, also one that hears nothing, and stay so until a person has armed."""
    bench.drive(_FLEX, 25)
    bench.rig.break_servo("FDS", how)
    for _ in range(40):
        if bench.drive(_FLEX, 1).stop_reason:
            break
    assert re.search(words, bench.seen.stop_reason), bench.seen.stop_reason
    bench.drive(_FLEX, 40)
    assert bench.pulls() == [0.0] * 7
    assert bench.seen.stop_reason != ""
    if how == "overload":
        with pytest.raises(RobotError, match=r"FDS .*overloaded. Only a reboot"):
            bench.robot.arm()
        return
    bench.rig.break_servo("FDS", "")
    bench.drive(_FLEX, 20)
    if how == "power" and bench.family == "Dynamixel":
        with pytest.raises(RobotError, match="FDS lost the power, and so the zero"):
            bench.robot.arm()
        return
    if how != "hot":
        bench.robot.arm()
        bench.drive(_FLEX, 40)
        assert bench.seen.stop_reason == ""
        assert min(bench.pulls()) > 0.0


def test_arming_does_not_keep_a_deaf_servo_pulling(bench: _Bench) -> None:
    """Whoever insists on arming while a servo hears nothing does not keep its power on."""
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


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda text: text.replace("\nid = 2\n", "\nid = 9\n"), r"no servo answers as FDS \(id 2"),
        (
            lambda text: re.sub(r"XL330-M077|STS3215", _other, text),
            r"FDP \(id 1\) is not an .*: its model number is",
        ),
    ],
)
def test_another_servo_than_in_the_profile_is_refused(
    family: str, change: Callable[[str], str], words: str
) -> None:
    """A servo with another id or of another model is named before anything moves."""
    wired = read(change(finger_text(family)))
    with pytest.raises(RobotError, match=words):
        _Bench(family, wired)


def _other(match: re.Match[str]) -> str:
    return "XL330-M288"


def test_zeros_are_found_and_kept(family: str) -> None:
    """Homing finds the zeros of a straight finger, and lets go."""
    plan = read(finger_text(family)).guard_plan()
    world = FingerWorld(NOMINAL, seed=3)
    board = LocalBoard(TwinWiring(plan), world)
    zeros = find_zeros(plan, board.hardware, lambda: board.pass_ns(_TICK_NS))
    assert tuple(zeros) == TENDONS
    board.pass_ns(20 * _TICK_NS)
    rig = board.pins.require_rig()
    assert [servo.pulls_a for servo in rig.servos.values()] == [0.0] * 7
    assert rig.has_power == (family == "Dynamixel")


def test_safe_pins_cut_the_power_of_feetech_servos() -> None:
    """After a crash the enable line falls, whatever the servos do; nothing is sent to them."""
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


def test_a_feetech_rig_needs_a_power_switch() -> None:
    """Without [enable] the error names the missing table."""
    text = finger_text("Feetech")
    words = r"FDP\] is an STS3215, which does not stop when its bus is silent: add \[enable\] with"
    with pytest.raises(ProfileError, match=words):
        read(text[: text.index("[enable]")])


def test_feetech_servos_find_their_turns_again() -> None:
    """Their lengths are right after each start, wherever within half a turn they stood."""
    bench = _Bench("Feetech")
    bench.drive(_FLEX, 60)
    angles = np.array([bench.robot._world.truth()[f"{name}/angle"] for name in JOINTS])
    expected = -MOMENT_ARMS @ angles
    bench.rig.set_power(on=False)
    bench.robot._advance(60 * _TICK_NS)
    bench.robot.arm()
    bench.seen, _ = bench.robot.step(_REST)
    got = [bench.length(name) for name in TENDONS]
    np.testing.assert_allclose(got, expected, atol=4e-3)
    assert min(got) < -0.008
    bench.robot.close()


@pytest.mark.realtime
def test_a_killed_guard_leaves_limp_servos(family: str, tmp_path: Path) -> None:
    """The guard is killed while it pulls; a second later only friction holds the tendons."""
    plan = read(finger_text(family)).guard_plan()
    daemon, its_end = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    heartbeat, its_heartbeat = socket.socketpair()
    place = finger_place(NOMINAL)
    with (
        start_board(plan, "twin", tmp_path, place=place) as board,
        Operator(board.socket_path) as operator,
        daemon,
        heartbeat,
        its_end,
        its_heartbeat,
    ):
        fd = plan_fd(ServePlan(guard=plan, daemon={}, hardware=board.hardware))
        command = [sys.executable, "-I", str(start.__file__), "guard", "--plan-fd", str(fd)]
        command += ["--daemon-fd", str(its_end.fileno())]
        command += ["--heartbeat-fd", str(its_heartbeat.fileno())]
        fds = (fd, its_end.fileno(), its_heartbeat.fileno())
        with subprocess.Popen(command, pass_fds=fds) as guard:
            daemon.setblocking(False)
            until(lambda: operator.advance(0.01) > 0 and _states(daemon) != [])
            now_ns = operator.advance(0.5)  # The servos start.
            daemon.send(encode(Order("arm", session=1, issued_ns=now_ns, person=True)))
            now_ns = operator.advance(0.05)
            assert any(state.armed for state in _states(daemon))
            for seq in range(1, 41):
                order = Order("command", 1, seq, issued_ns=now_ns, ttl_ms=1000, values=_ALL)
                daemon.send(encode(order))
                now_ns = operator.advance(0.02)
            pulled = operator.tensions()["FDP"]
            guard.kill()
            guard.wait()
            operator.advance(1.0)
            left = operator.tensions()
    friction_n = 0.5 if family == "Dynamixel" else 5.2
    assert pulled > 1.6 * friction_n
    assert max(left.values()) < 1.1 * friction_n


def _states(daemon: socket.socket) -> list[GuardState]:
    states: list[GuardState] = []
    with contextlib.suppress(BlockingIOError):
        while data := daemon.recv(65536):
            states.append(decode_state(data))
    return states
