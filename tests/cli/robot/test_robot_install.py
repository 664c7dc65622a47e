"""`shapechanger robot install`: what it says, and whom it refuses."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from shapechanger.cli.robot.setup import Install
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
    """A car that `init` made."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    make_credentials(tmp_path / "config/shapechanger/robots/rover", "rover")
    return load_profile(write_profile("car", tmp_path / "home/rover.toml", "rover"))


def _said(
    pi: FakePi, car: Profile, capsys: pytest.CaptureFixture[str], command: Install
) -> list[str]:
    command.install(car, pi.machine)
    return capsys.readouterr().out.splitlines()


def test_it_says_what_it_did(pi: FakePi, car: Profile, capsys: pytest.CaptureFixture[str]) -> None:
    """Once done, everything is there already, and nothing has to follow."""
    command = Install("rover.toml")
    said = _said(pi, car, capsys, command)
    unit = pi.root / "etc/systemd/system/shapechanger-rover.service"
    assert "did      group gpio: pi is in the group gpio." in said
    assert f"did      service: {unit} is the unit next to the profile." in said
    assert any(line.startswith("Restart the computer") for line in said)
    # Which logs in again, too.
    assert not any(line.startswith("Log out and in") for line in said)
    assert any("sudo systemctl start shapechanger-rover" in line for line in said)
    assert f"robot serve {car.path} " in f"{unit.read_text()} ".replace("\n", " ")
    again = _said(pi, car, capsys, command)
    assert [line for line in again if line.startswith("did")] == []
    assert not any(line.startswith("Restart the computer") for line in again)


def test_a_dry_run_needs_the_unit_only(
    pi: FakePi, car: Profile, capsys: pytest.CaptureFixture[str]
) -> None:
    """It writes nothing, so the unit of `init` has to be there."""
    with pytest.raises(RobotError, match="it is written without --dry-run"):
        Install("rover.toml", dry_run=True).install(car, pi.machine)
    _said(pi, car, capsys, Install("rover.toml"))
    pi.ran.clear()
    (pi.root / "etc/systemd/system/shapechanger-rover.service").unlink()
    said = _said(pi, car, capsys, Install("rover.toml", dry_run=True))
    assert any(line.startswith("would    service: sudo install -m 644 ") for line in said)
    assert pi.ran == []


def test_a_failure_is_counted(pi: FakePi, car: Profile, capsys: pytest.CaptureFixture[str]) -> None:
    """The exit code is 1, and the command is printed."""
    pi.refuses = "systemctl"
    with pytest.raises(SystemExit) as exited:
        Install("rover.toml").install(car, pi.machine)
    assert exited.value.code == 1
    said = capsys.readouterr().out
    assert "FAILED   start: systemctl: permission denied. By hand: sudo systemctl enable" in said
    assert "could not be done." in said


def test_new_groups_alone_need_a_login(
    pi: FakePi, car: Profile, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without a line of config.txt, no restart is asked for."""
    pi.write("boot/firmware/config.txt", "dtparam=strict_gpiod\ncamera_auto_detect=1\n")
    said = _said(pi, car, capsys, Install("rover.toml"))
    assert any(line.startswith("Log out and in") for line in said)
    assert not any(line.startswith("Restart the computer") for line in said)


def test_a_path_with_blanks_is_one_word(
    pi: FakePi, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """In the unit, and for the install that reads it."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    make_credentials(tmp_path / "config/shapechanger/robots/rover", "rover")
    car = load_profile(write_profile("car", tmp_path / "my robots/rover.toml", "rover"))
    _said(pi, car, capsys, Install("rover.toml"))
    unit = pi.root / "etc/systemd/system/shapechanger-rover.service"
    assert f'robot serve "{car.path}"\n' in unit.read_text()
    _said(pi, car, capsys, Install("rover.toml"))


def test_the_profile_of_this_folder_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A shipped name is meant for the file of that name, if it exists."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(RobotError, match="`shapechanger robot init car` writes your own"):
        Install("car").run()
    Path("car.toml").touch()
    with pytest.raises(RobotError, match=r"car\.toml in this folder is your own"):
        Install("car").run()


def test_it_is_removed(pi: FakePi, car: Profile, capsys: pytest.CaptureFixture[str]) -> None:
    """The service is gone; groups stay."""
    _said(pi, car, capsys, Install("rover.toml"))
    said = _said(pi, car, capsys, Install("rover.toml", remove=True))
    assert len(said) == 1
    assert said[0].startswith("did      service: ")
    assert not list((pi.root / "etc/systemd").rglob("shapechanger*"))
    assert "gpio:x:1:pi" in (pi.root / "etc/group").read_text()


def test_who_is_refused(pi: FakePi, car: Profile) -> None:
    """Root, another computer, a robot without its key, and a unit of another profile."""
    command = Install("rover.toml")
    with pytest.raises(RobotError, match="without sudo"):
        command.install(car, replace(pi.machine, user="root"))
    unit = car.path.with_name("shapechanger-rover.service")
    unit.write_text("[Service]\n")
    with pytest.raises(RobotError, match=r"does not name .*rover\.toml: remove it"):
        command.install(car, pi.machine)
    unit.unlink()
    command.install(car, pi.machine)
    unit.write_text(unit.read_text().replace("User=pi", "User=root"))
    pi.ran.clear()
    with pytest.raises(RobotError, match="does not run the robot as pi"):
        command.install(car, pi.machine)
    shutil.rmtree(pi.root / "run/systemd")
    with pytest.raises(RobotError, match="not run by systemd"):
        Install("rover.toml", remove=True).install(car, pi.machine)
    assert pi.ran == []


def test_a_robot_without_its_key_is_refused(pi: FakePi, car: Profile, tmp_path: Path) -> None:
    """Its service could not serve it."""
    shutil.rmtree(tmp_path / "config")
    with pytest.raises(RobotError, match="Run `shapechanger robot init`"):
        Install("rover.toml").install(car, pi.machine)
    assert pi.ran == []
