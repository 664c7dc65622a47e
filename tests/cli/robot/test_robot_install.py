"""`shapechanger robot install`: what it says, and whom it refuses."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from shapechanger.cli.robot.setup import RobotInstall
from shapechanger.errors import RobotError
from shapechanger.robot.daemon.credentials import make_credentials
from shapechanger.robot.profile.load import load_profile, write_profile
from shapechanger.robot.profile.profile import Profile
from tests.robot.setup.fake_pi import FakePi


@pytest.fixture
def pi(tmp_path: Path) -> FakePi:
    """A fresh Raspberry Pi."""
    return FakePi(tmp_path / "pi")


@pytest.fixture
def car(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Profile:
    """A car that `init` made, in a folder with a blank."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    make_credentials(tmp_path / "config/shapechanger/robots/rover", "rover")
    return load_profile(write_profile("car", tmp_path / "my home/rover.toml", "rover"))


Said = Callable[..., list[str]]


@pytest.fixture
def said(pi: FakePi, car: Profile, capsys: pytest.CaptureFixture[str]) -> Said:
    """Install the car with some options, and return the printed lines."""

    def run(**options: bool) -> list[str]:
        RobotInstall("rover.toml", **options).install(car, pi.machine)
        return capsys.readouterr().out.splitlines()

    return run


def test_it_says_what_it_did(pi: FakePi, car: Profile, said: Said) -> None:
    """Once done, everything is there already, and nothing has to follow."""
    lines = said()
    unit = pi.root / "etc/systemd/system/shapechanger-rover.service"
    assert "did      group gpio: pi is in the group gpio." in lines
    assert any(f"did      service: {unit} is the unit next to" in line for line in lines)
    assert any(line.startswith("Restart the computer") for line in lines)
    # Which logs in again, too.
    assert not any(line.startswith("Log out and in") for line in lines)
    assert any("sudo systemctl start shapechanger-rover" in line for line in lines)
    assert f'robot serve "{car.path}"\n' in unit.read_text()
    assert not any(line.startswith(("did", "Restart the computer")) for line in said())
    (line,) = said(remove=True)
    assert line.startswith("did      service: ")


def test_a_dry_run_needs_the_unit_only(pi: FakePi, said: Said) -> None:
    """A dry run writes nothing, so the unit of `init` has to be there."""
    with pytest.raises(RobotError, match="it is written without --dry-run"):
        said(dry_run=True)
    said()
    pi.ran.clear()
    (pi.root / "etc/systemd/system/shapechanger-rover.service").unlink()
    lines = said(dry_run=True)
    assert any(line.startswith("would    service: sudo install -m 644 ") for line in lines)
    assert pi.ran == []


def test_who_is_refused(pi: FakePi, car: Profile, said: Said, tmp_path: Path) -> None:
    """Root, a unit of another profile or user, a robot without its key, and another computer."""
    with pytest.raises(RobotError, match="without sudo"):
        RobotInstall("rover.toml").install(car, replace(pi.machine, user="root"))
    unit = car.path.with_name("shapechanger-rover.service")
    unit.write_text("[Service]\n")
    with pytest.raises(RobotError, match=r"does not run .*rover\.toml as .*: remove it"):
        said()
    unit.unlink()
    said()
    unit.write_text(unit.read_text().replace("User=pi", "User=root"))
    pi.ran.clear()
    with pytest.raises(RobotError, match=r"does not run .* as pi"):
        said()
    shutil.rmtree(tmp_path / "config")
    with pytest.raises(RobotError, match="Run `shapechanger robot init`"):
        said()
    shutil.rmtree(pi.root / "run/systemd")
    with pytest.raises(RobotError, match="not run by systemd"):
        said(remove=True)
    assert pi.ran == []
