"""`shapechanger robot init` with its questions, and `shapechanger robot install`."""

import io
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from shapechanger.cli.robot.setup import RobotInit, RobotInstall
from shapechanger.errors import RobotError, ShapechangerError
from shapechanger.robot.daemon.credentials import make_credentials
from shapechanger.robot.profile.load import load_profile, shipped_profiles, write_profile
from shapechanger.robot.profile.profile import Profile
from tests.robot.setup.fake_pi import FakePi


class _Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[list[str], list[str]]:
    """Two lists: the questions so far, and the answers to give; after them Ctrl-D is pressed."""
    questions: list[str] = []
    answers: list[str] = []

    def answer() -> str:
        questions.append("")
        if not answers:
            raise EOFError
        return answers.pop(0)

    monkeypatch.setattr("builtins.input", answer)
    monkeypatch.setattr("sys.stdin", _Terminal())
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path / "work")
    return questions, answers


def test_enter_selects_the_defaults(asked: tuple[list[str], list[str]]) -> None:
    questions, answers = asked
    answers += [""] * 4
    RobotInit().run()
    assert len(questions) == 4
    assert Path("car.toml").read_text() == shipped_profiles()["car"].read_text()


def test_answers_are_checked(
    asked: tuple[list[str], list[str]], capsys: pytest.CaptureFixture[str]
) -> None:
    _, answers = asked
    answers += ["kar", "tank", "rover", "noen", "none", "anyone"]
    RobotInit().run()
    said = capsys.readouterr().out
    for text in (
        "  car         The New Bright car of the original release (2017)",
        "select one of the available options",
        "Next: shapechanger robot install rover.toml",
    ):
        assert text in said
    profile = load_profile("rover.toml")
    assert (profile.name, profile.body, profile.camera) == ("rover", "tank", None)
    assert profile.arming == "anyone"
    for name, reason in (("rover", r"Cannot write rover\.toml: it exists"), ("../up", "name")):
        answers += ["tank", name, "none", "anyone"]
        with pytest.raises(ShapechangerError, match=reason):
            RobotInit().run()


def test_the_end_of_the_answers_writes_nothing(
    asked: tuple[list[str], list[str]], tmp_path: Path
) -> None:
    _, answers = asked
    answers += ["car", "rover"]
    with pytest.raises(RobotError, match="no file was written"):
        RobotInit().run()
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_with_arguments_no_question_is_asked(
    asked: tuple[list[str], list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(RobotError, match=r"`shapechanger robot init car`. There are: .*boat"):
        RobotInit(name="rover").run()
    RobotInit("car", "bench", camera="none").run()
    assert load_profile("bench.toml").camera is None
    monkeypatch.setattr("sys.stdin", io.StringIO())
    with pytest.raises(RobotError, match="Name the kind"):
        RobotInit().run()
    assert asked[0] == []


@pytest.fixture
def pi(tmp_path: Path) -> FakePi:
    return FakePi(tmp_path / "pi")


@pytest.fixture
def car(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Profile:
    """A car that `init` has made, in a folder whose name has a blank."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    make_credentials(tmp_path / "config/shapechanger/robots/rover", "rover")
    return load_profile(write_profile("car", tmp_path / "my home/rover.toml", "rover"))


Said = Callable[..., list[str]]


@pytest.fixture
def said(pi: FakePi, car: Profile, capsys: pytest.CaptureFixture[str]) -> Said:
    def run(**options: bool) -> list[str]:
        RobotInstall("rover.toml", **options).install(car, pi.machine)
        return capsys.readouterr().out.splitlines()

    return run


def test_install_reports_each_change(pi: FakePi, car: Profile, said: Said) -> None:
    lines = said()
    unit = pi.root / "etc/systemd/system/shapechanger-rover.service"
    assert "did      group gpio: pi is in the group gpio." in lines
    assert any(f"did      service: {unit} is a copy of the unit" in line for line in lines)
    assert any(line.startswith("Restart the computer") for line in lines)
    assert any("sudo systemctl start shapechanger-rover" in line for line in lines)
    assert f'robot serve "{car.path}"\n' in unit.read_text()
    assert not any(line.startswith(("did", "Restart the computer")) for line in said())
    (line,) = said(remove=True)
    assert line.startswith("did      service: ")


def test_a_dry_run_needs_the_unit_only(pi: FakePi, said: Said) -> None:
    """A dry run writes no file, so the unit next to the profile must exist."""
    with pytest.raises(RobotError, match="without --dry-run, this command writes it"):
        said(dry_run=True)
    said()
    pi.ran.clear()
    (pi.root / "etc/systemd/system/shapechanger-rover.service").unlink()
    lines = said(dry_run=True)
    assert any(line.startswith("would    service: sudo install -m 644 ") for line in lines)
    assert pi.ran == []


def test_an_unsuitable_user_unit_key_or_computer_is_refused(
    pi: FakePi, car: Profile, said: Said, tmp_path: Path
) -> None:
    """Root, units of another profile or user, robots without a key and other computers fail."""
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
