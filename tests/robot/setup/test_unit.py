"""The systemd unit of a new robot."""

from dataclasses import replace
from pathlib import Path

from shapechanger.robot.check.report import Finding
from shapechanger.robot.check.standing import StandingRobot, examine
from shapechanger.robot.setup.systemd import unit_text, unit_word, write_unit
from tests.robot.check.held_pins import shipped


def test_the_unit_names_profile_program_and_user(tmp_path: Path) -> None:
    """All placeholders are replaced."""
    text = unit_text("car", tmp_path / "car.toml", "/opt/venv/bin/shapechanger", "pi", tmp_path)
    started = f"ExecStart=/opt/venv/bin/shapechanger robot serve {tmp_path}/car.toml"
    assert f"{started} --credentials {tmp_path}\n" in text
    assert "User=pi" in text
    assert "@" not in text


def _finding(root: Path, profile: Path) -> Finding:
    robot = StandingRobot(replace(shipped("car"), path=profile, camera=None), root=root)
    return next(finding for finding in examine(robot) if finding.check == "systemd")


def test_the_check_accepts_the_unit_of_init(tmp_path: Path) -> None:
    """The written unit passes its check, unless it is for another profile."""
    folder = tmp_path / "etc/systemd/system"
    folder.mkdir(parents=True)
    path, is_new = write_unit("car", folder / "car.toml")

    assert is_new
    assert path.parent == folder
    assert path.name == "shapechanger-car.service"
    assert _finding(tmp_path, folder / "car.toml").level == "good"
    other = _finding(tmp_path, folder / "other.toml")
    assert other.level == "bad"
    assert "for another profile" in other.sentence


def test_an_existing_unit_is_kept(tmp_path: Path) -> None:
    """An existing file is not overwritten."""
    path, _ = write_unit("car", tmp_path / "car.toml")
    path.write_text("mine")
    assert write_unit("car", tmp_path / "car.toml") == (path, False)
    assert path.read_text() == "mine"


def test_words_of_a_unit_are_quoted() -> None:
    """What systemd would split, expand or take for the end of a line."""
    assert unit_word("/home/pi/car-2.toml") == "/home/pi/car-2.toml"
    assert unit_word("/my robots/100%.toml") == '"/my robots/100%%.toml"'
    assert unit_word('/a"b\\c$d\ne') == '"/a\\"b\\\\c$$d\\ne"'
    text = unit_text("my car", Path("/@USER@/a\nUser=root"), "/bin/shapechanger", "pi")
    assert [line for line in text.splitlines() if line.startswith("User=")] == ["User=pi"]
    assert 'robot serve "/@USER@/a\\nUser=root"\n' in text
    assert "Description=Shapechanger robot my-car\n" in text


def test_the_check_reads_quoted_paths(tmp_path: Path) -> None:
    """A profile in a folder with a blank is found in its unit."""
    folder = tmp_path / "etc/systemd/system"
    folder.mkdir(parents=True)
    profile = tmp_path / "my robots/car.toml"
    path, _ = write_unit("car", profile)
    (folder / path.name).write_bytes(path.read_bytes())
    assert _finding(tmp_path, profile).level == "good"
