"""The rig of a finger in one process: the real guard and drivers, bones in MuJoCo."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from shapechanger.errors import UnknownName
from shapechanger.finger.anatomy import JOINT_REST, JOINTS, MOMENT_ARMS, TENDONS
from shapechanger.finger.parameters import NOMINAL
from shapechanger.finger.twin import FingerWorld
from shapechanger.layout import Layout
from shapechanger.robot.drivers.servos.simulation import Rig
from shapechanger.robot.link.messages import Observation
from shapechanger.robot.profile.load import find_profile, load_profile, shipped_profiles
from tests.robot.twin.in_process import InProcessRobot

_REST = (0.0,) * 7
_FLEX = (0.65, 0.65, 0.0, 0.0, 0.0, 0.0, 0.0)


# Torque for an ampere of an XL330-M077 on a spool of 10 mm, N.
_N_PER_A = 0.215 / 1.47 / 0.010


class _Bench:
    """An armed rig."""

    def __init__(self) -> None:
        self.world = FingerWorld(NOMINAL, seed=3)
        self.robot = InProcessRobot(load_profile(find_profile("finger")), self.world)
        self.seen = self.robot.start()
        self.names = Layout.from_json(self.robot.welcome.state_layout).names

    @property
    def rig(self) -> Rig:
        return self.robot.pins.require_rig()

    def drive(self, values: tuple[float, ...], steps: int) -> Observation:
        for _ in range(steps):
            self.seen, _ = self.robot.step(values)
        return self.seen

    def state(self, what: str) -> NDArray[np.float64]:
        return np.array([self.seen.state[self.names.index(f"{t}/{what}")] for t in TENDONS])


@pytest.fixture
def bench() -> Iterator[_Bench]:
    """An armed rig, closed after the test."""
    made = _Bench()
    yield made
    made.robot.close()


def test_commands_map_to_tensions(bench: _Bench) -> None:
    """Command 0 is the pretension and 1 the largest tension, to one count of current."""
    bench.drive(_REST, 5)
    pulls = [servo.pulls_a * _N_PER_A for servo in bench.rig.servos.values()]
    assert pulls == pytest.approx([1.0] * 7, abs=0.02)
    bench.drive((1.0, *_REST[1:]), 15)
    assert bench.rig.servo("FDP").pulls_a * _N_PER_A == pytest.approx(15.0, abs=0.02)
    assert bench.seen.action_applied == pytest.approx((1.0, *_REST[1:]))
    assert bench.seen.stop_reason == ""


def test_sensed_lengths_match_the_joint_angles(bench: _Bench) -> None:
    bench.drive(_FLEX, 50)
    angles = np.array([bench.world.truth()[f"{n}/angle"] for n in JOINTS])
    assert angles[0] > JOINT_REST[0] + 0.2
    stretch = np.array([bench.rig.tensions()[name] for name in TENDONS]) / 20e3
    np.testing.assert_allclose(bench.state("length"), -MOMENT_ARMS @ angles - stretch, atol=2e-4)
    assert bench.state("tension")[0] == pytest.approx(1.0 + 0.65 * 14.0, abs=0.1)
    assert bench.seen.sources["FDP/length"] == "tendons"


def test_the_same_commands_give_the_same_motion() -> None:
    ends: list[tuple[float, ...]] = []
    for _ in range(2):
        bench = _Bench()
        ends.append(bench.drive(_FLEX, 20).state)
        bench.robot.close()
    assert ends[0] == ends[1]


def test_a_snapped_tendon_releases_all_tendons(bench: _Bench) -> None:
    """Tendons go to the pretension in 0.3 s, then to zero; later commands have no effect."""
    bench.drive(_FLEX, 25)
    assert bench.rig.tensions()["FDP"] > 5.0
    bench.rig.break_servo("FDS", "snapped")
    steps = 0
    while not bench.seen.stop_reason:
        bench.drive((1.0,) * 7, 1)
        steps += 1
        assert steps < 40
    assert re.search("FDS .*lost its tendon", bench.seen.stop_reason), bench.seen.stop_reason
    bench.drive(_FLEX, 16)
    others = [s for s in bench.rig.servos.values() if s is not bench.rig.servo("FDS")]
    goal = max(abs(servo.pulls_a) for servo in others) * _N_PER_A
    assert goal < 1.05
    bench.drive(_FLEX, 20)
    assert [servo.pulls_a for servo in others] == [0.0] * 6
    assert max(bench.rig.tensions().values()) < 2.0
    assert bench.seen.stop_reason != ""


def test_a_missing_magnet_releases_all_tendons(bench: _Bench) -> None:
    """Tendons go to the pretension, then to zero, and stay released until a person arms."""
    bench.drive(_FLEX, 25)
    magnet = bench.robot.pins.encoder("PIP_flexion")
    magnet.set_magnet("gone")
    bench.drive(_FLEX, 2)
    assert bench.seen.stop_reason == ""  # A short loss only marks the joint absent.
    assert bench.seen.sources["PIP_flexion/angle"] == "absent"
    bench.drive(_FLEX, 2)
    assert "The encoder of PIP_flexion, on channel 2, detects no magnet." in bench.seen.stop_reason
    assert not bench.seen.armed
    bench.drive(_FLEX, 36)
    assert [servo.pulls_a for servo in bench.rig.servos.values()] == [0.0] * 7
    magnet.set_magnet("")
    bench.drive(_FLEX, 5)
    assert "no magnet" in bench.seen.stop_reason
    bench.robot.arm()
    bench.drive(_FLEX, 20)
    assert bench.seen.stop_reason == ""


def test_placing_the_finger_keeps_the_tendons_taut(bench: _Bench) -> None:
    """Placing the finger sets the tendon lengths to its pose without loading them."""
    bench.world.place(7)
    assert max(bench.rig.tensions().values()) == 0.0
    bench.drive(_REST, 2)
    assert max(bench.rig.tensions().values()) < 5.0
    angles = np.array([bench.world.truth()[f"{n}/angle"] for n in JOINTS])
    np.testing.assert_allclose(bench.state("length"), -MOMENT_ARMS @ angles, atol=5e-4)


def test_unknown_tendons_and_faults_are_refused(bench: _Bench) -> None:
    """The error suggests the names of the profile."""
    with pytest.raises(UnknownName, match=r"'FDPP'. Did you mean 'FDP'"):
        bench.rig.break_servo("FDPP", "mute")
    with pytest.raises(UnknownName, match="fault of a servo"):
        bench.rig.break_servo("FDP", "hott")  # pyright: ignore[reportArgumentType]


def test_a_rig_that_controls_lengths_flexes_and_releases(tmp_path: Path) -> None:
    """Lengths move the finger through guard and bus, and the rest is the pretension."""
    text = shipped_profiles()["finger"].read_text()
    keys = 'control = "length"\nlongest_m = 0.012\nshortest_m = -0.03\nmodel ='
    path = tmp_path / "finger.toml"
    path.write_text(text.replace("model =", keys))
    robot = InProcessRobot(load_profile(path), FingerWorld(NOMINAL, seed=3))
    names = Layout.from_json(robot.welcome.state_layout).names
    try:
        robot.start()
        rig = robot.pins.require_rig()
        for _ in range(60):  # Flexors to -17 mm, the others let out.
            seen, _ = robot.step((0.7, 0.7, 0.01, 0.01, 0.01, 0.01, 0.01))
        assert seen.state[names.index("FDP/length")] == pytest.approx(-0.0174, abs=2e-3)
        assert seen.state[names.index("PIP_flexion/angle")] > 0.3
        assert all(servo.register(11) == 5 for servo in rig.servos.values())
        for _ in range(60):
            robot.step(_REST)
        # The friction of the gears, 0.5 N, adds to the pretension of 1 N.
        assert max(rig.tensions().values()) < 1.6
    finally:
        robot.close()
