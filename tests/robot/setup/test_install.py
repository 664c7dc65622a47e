"""Installation of a robot on a fake Raspberry Pi."""

import sys
from dataclasses import replace
from pathlib import Path

import pytest

from shapechanger.errors import RobotError
from shapechanger.robot.check.standing import StandingRobot, examine
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.setup.install import (
    RootCommand,
    changes_to_install,
    changes_to_remove,
    make_changes,
    run_as_root,
    write_unit,
)
from tests.robot.check.held_pins import shipped
from tests.robot.setup.fake_pi import FakePi

_UNIT = "etc/systemd/system/shapechanger-car.service"


def _blind(kind: str) -> Profile:
    return replace(shipped(kind), camera=None)


def _install(pi: FakePi, robot: Profile, *, dry: bool = False) -> dict[str, tuple[str, str]]:
    unit, _ = write_unit(robot.name, pi.root / "my home" / f"{robot.name}.toml")
    changes = changes_to_install(robot, unit, pi.machine)
    made = make_changes(changes, pi.run, dry=dry)
    return {change.name: (level, sentence) for change, level, sentence in made}


def _levels(found: dict[str, tuple[str, str]]) -> dict[str, str]:
    return {name: level for name, (level, _) in found.items()}


@pytest.fixture
def pi(tmp_path: Path) -> FakePi:
    return FakePi(tmp_path)


def test_the_checks_are_good_after_an_installation(pi: FakePi) -> None:
    """`install` corrects the settings of the computer that the checks find bad.

    A line below a filter, such as [pi5], applies to one model; the added line applies to all.
    """
    pi.write("boot/firmware/config.txt", "[pi5]\ndtparam=strict_gpiod\n")
    profile = replace(_blind("car"), path=pi.root / "my home" / "car.toml")
    for expected in ("bad", "good"):
        levels = {one.check: one.level for one in examine(StandingRobot(profile, root=pi.root))}
        assert (levels["strict_gpiod"], levels["systemd"]) == (expected, expected)
        _install(pi, profile)
    assert pi.config.endswith("[pi5]\ndtparam=strict_gpiod\n\n[all]\ndtparam=strict_gpiod\n")


def test_a_servo_board_and_a_rig_need_i2c(pi: FakePi) -> None:
    found = _levels(_install(pi, _blind("car-esc")))
    assert (found["I2C"], found["group i2c"]) == ("did", "did")
    assert (pi.root / "etc/modules-load.d/i2c-dev.conf").exists()
    found = _levels(_install(pi, _blind("finger")))
    did = ("latency timer", "I2C speed", "group dialout")
    assert ([found[name] for name in did], found["I2C"]) == (["did"] * 3, "already")
    assert set(_levels(_install(pi, _blind("finger"))).values()) == {"already"}


def test_a_failed_change_is_reported_with_its_command(
    pi: FakePi, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A command with exit code 0 but no effect has failed; missing parts of the OS are named."""
    pi.refuses = "usermod"
    found = _install(pi, _blind("car"))
    sentence = "usermod: permission denied. By hand: sudo usermod -aG gpio pi"
    assert (found["group gpio"], found["service"][0]) == (("FAILED", sentence), "did")
    other = FakePi(tmp_path / "other", config=None, groups=())
    monkeypatch.setattr(other, "run", lambda _: "")
    found = _install(other, shipped("car"))
    sentence = "This machine has no group gpio; Raspberry Pi OS has one."
    assert found["group gpio"] == ("FAILED", sentence)
    for part in ("no config.txt", "dtparam=strict_gpiod"):
        assert part in found["strict_gpiod"][1]
    assert "the command had no effect" in found["service"][1]


def test_the_service_is_removed(pi: FakePi) -> None:
    pi.write(_UNIT, "old")
    found = _install(pi, shipped("car"), dry=True)
    assert found["group gpio"] == ("would", "sudo usermod -aG gpio pi")
    assert (pi.ran, found["picamera2"][0]) == ([], "already")
    assert _install(pi, _blind("car"))["service"][0] == "did"
    assert "shapechanger.robot.safe_pins" in (pi.root / _UNIT).read_text()
    for level in ("did", "already"):
        changes = changes_to_remove("shapechanger-car.service", pi.root)
        assert [made for _, made, _ in make_changes(changes, pi.run)] == [level]
    assert not list((pi.root / "etc/systemd").rglob("shapechanger*"))
    assert "dtparam=strict_gpiod" in pi.config


def test_commands_run_as_root(pi: FakePi, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without root, commands use sudo; a failure returns its last line; only a Pi is accepted."""
    code = "import sys; sys.stderr.write('one\\ntwo\\n'); sys.exit(len(sys.stdin.read()))"
    script = RootCommand((sys.executable, "-c", code), "text")
    monkeypatch.setattr("os.geteuid", lambda: 0)
    assert run_as_root(script) == "two"
    assert run_as_root(script._replace(text="")) == ""
    silent = RootCommand((sys.executable, "-c", "raise SystemExit(3)"))
    assert run_as_root(silent) == f"{sys.executable} exited with 3"
    monkeypatch.setattr("os.geteuid", lambda: 1000)
    monkeypatch.setenv("PATH", "")
    assert run_as_root(script) == "sudo: No such file or directory"
    pi.machine.require_pi()
    (pi.root / "proc/device-tree/model").unlink()
    with pytest.raises(RobotError, match=r"not a Raspberry Pi.*Raspberry Pi OS"):
        pi.machine.require_pi()


def test_the_unit_names_profile_program_and_user(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Placeholders are replaced, and characters that systemd would split or expand are quoted."""
    monkeypatch.setattr("shutil.which", lambda _: "/opt/venv/bin/shapechanger")
    profile = tmp_path / "@USER@ 1" / 'a\nUser=$1 100% "b\\c".toml'
    path, is_new = write_unit("my car", profile, tmp_path, "pi")
    assert (path, is_new) == (profile.parent / "shapechanger-my-car.service", True)
    text = path.read_text()
    word = f'"{tmp_path}/@USER@ 1/a\\nUser=$$1 100%% \\"b\\\\c\\".toml"'
    start = f"ExecStart=/opt/venv/bin/shapechanger robot serve {word} --credentials {tmp_path}\n"
    assert start in text
    assert [line for line in text.splitlines() if line.startswith("User=")] == ["User=pi"]
    assert "Description=Shapechanger robot my-car\n" in text
    path.write_text("mine")
    assert write_unit("my car", profile) == (path, False)
    assert path.read_text() == "mine"
