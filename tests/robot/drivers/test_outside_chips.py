"""Chips of another package: a sensor and an actuator in one file each; and keys of all chips."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from scripts.site_hooks import with_keys
from shapechanger.contract.plan import GuardPlan
from shapechanger.errors import RobotError
from shapechanger.layout import Layout
from shapechanger.robot.drivers import chip
from shapechanger.robot.drivers.chip import OUTPUTS, PULSES, SENSORS
from shapechanger.robot.profile import Profile, load_profile, read_profile, shipped_profiles
from shapechanger.robot.twin.ledger import TwinWiring
from shapechanger.robot.twin.room import DrivingWorld
from tests.robot.drivers.outside.bh1750 import LUX
from tests.robot.twin.in_process import InProcessRobot

_HERE = "tests.robot.drivers.outside"
_LINES = """
[action.horn]
one_sided = true

[output.horn]
driver = "relay"
pin = 4
mix = { horn = 1.0 }

[sensor.sky]
driver = "bh1750"
"""


def _install(folder: Path, monkeypatch: pytest.MonkeyPatch, entries: str) -> None:
    info = folder / "outside-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: outside\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[shapechanger.drivers]\n{entries}")
    monkeypatch.syspath_prepend(folder)
    chip._others.cache_clear()


@pytest.fixture
def _outside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    entries = f"bh1750 = {_HERE}.bh1750:CHIP\nrelay = {_HERE}.relay:CHIP\n"
    _install(tmp_path, monkeypatch, entries)
    yield
    chip._others.cache_clear()


def _read(lines: str) -> Profile:
    text = shipped_profiles()["lab-car"].read_text() + lines
    return read_profile(text, Path("lab-car.toml"))


@pytest.mark.usefixtures("_outside")
def test_the_guide_lists_chips_of_another_package() -> None:
    guide = with_keys("<!-- keys: profile sensor -->\n\n<!-- keys: profile output -->")
    assert '#### `driver = "bh1750"`\n\nKeys of a BH1750.' in guide
    assert '#### `driver = "relay"`' in guide


@pytest.mark.usefixtures("_outside")
def test_chips_of_another_package_are_driven_on_the_twin() -> None:
    profile = _read(_LINES)
    world = DrivingWorld({"wheels", "steering"}, (160, 120), seed=1)
    robot = InProcessRobot(profile, world, pictures=False)
    wiring = TwinWiring(profile.guard_plan())
    names = Layout.from_json(robot.welcome.state_layout).names
    robot.start()
    for horn in (1.0, 0.0):
        seen, _ = robot.step((0.0, 0.0, horn))
        assert seen.state[names.index("sky/light")] == pytest.approx(LUX)
        assert seen.action_applied[2] == horn
        assert wiring.read(robot.pins.levels, robot.now_ns)["horn"] == (horn, horn == 0.0)
    robot.close()


def test_an_entry_point_must_name_a_chip(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Other objects are refused; the package's own drivers cannot be replaced."""
    _install(tmp_path, monkeypatch, f"servo = {_HERE}.relay:CHIP\nlux = {_HERE}.bh1750:LUX\n")
    with pytest.raises(
        RobotError, match=r"entry point lux in shapechanger\.drivers must name a Sen"
    ):
        list(SENSORS)
    assert OUTPUTS["servo"].pulses
    chip._others.cache_clear()


@pytest.mark.parametrize("name", sorted(shipped_profiles()))
def test_a_driver_reads_the_keys_of_its_profile_from_a_plan(name: str) -> None:
    """The settings of a plan round-trip as JSON, and as the keys of their driver."""
    plan = load_profile(shipped_profiles()[name]).guard_plan()
    assert GuardPlan.from_json(plan.to_json()) == plan
    pulsed = [output for output in plan.outputs if "over" in output.settings]
    for part, driver in (
        *((output, OUTPUTS[output.driver]) for output in plan.outputs),
        *((output, PULSES[output.settings["over"]]) for output in pulsed),
        *((sensor, SENSORS[sensor.driver]) for sensor in plan.sensors),
    ):
        keys = driver.keys.of(part.settings)
        assert driver.keys.of(keys.settings()) == keys
        assert keys.settings().items() <= part.settings.items()
