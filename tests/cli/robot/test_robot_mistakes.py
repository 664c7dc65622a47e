"""Mistakes in `shapechanger robot` commands give one sentence and leave no files."""

import errno
import io
import os
import shutil
import socket
import tempfile
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from shapechanger.cli.robot.check import ask_person
from shapechanger.robot import safe_pins
from shapechanger.robot.daemon.credentials import make_credentials
from shapechanger.robot.discovery import FoundRobot
from shapechanger.robot.link.address import Address
from shapechanger.robot.profile.load import load_profile
from shapechanger.robot.twin.start import start_board
from tests.cli.running import Cli
from tests.robots import CAR, IN_A_ROOM, changed, write_profile

pytestmark = pytest.mark.realtime

PINS = list(Path("/dev").glob("gpiochip*"))
WITHOUT_PINS = pytest.mark.skipif(bool(PINS), reason="This machine has pins.")
KEY = "F3KI-CLDB-JQNI-LWGB-LOBU-SJPT-5E"


@pytest.fixture
def robot(capsys: pytest.CaptureFixture[str]) -> Cli:
    return Cli(capsys, "robot")


@pytest.fixture(autouse=True)
def home(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A working folder and empty folders of the user; its path is short, as for sockets."""
    tmp_path = Path(tempfile.mkdtemp())
    for name, variable in (("config", "XDG_CONFIG_HOME"), ("tmp", "TMPDIR")):
        (tmp_path / name).mkdir()
        monkeypatch.setenv(variable, str(tmp_path / name))
    monkeypatch.setattr("tempfile.tempdir", None)
    monkeypatch.setattr("sys.stdin", io.StringIO())
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path / "work")
    yield tmp_path
    shutil.rmtree(tmp_path)


def files(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


def write_ready_profile(home: Path, text: str = CAR) -> str:
    profile = write_profile(home / "work", text)
    make_credentials(home / "config" / "shapechanger" / "robots" / profile.name, profile.name)
    return str(profile.path)


TWINS = (
    *(("clock twin", "clock twin"), ("wired-as car", "wired-as"), ("twin-folder .", "twin-folder")),
    *(("world room", "world"), ("lens night", "lens"), ("seed 4", "seed"), ("gap wide", "gap")),
)
MISTAKES = (
    ("init nocar", "No kind of robot matches 'nocar'"),
    ("init", "Name the kind of the new robot"),
    ("serve nocar", "No profile matches 'nocar'. Did you mean 'car'?"),
    ("serve nowhere.toml", "There is no file nowhere.toml"),
    ("serve twice.toml", "22"),
    ("serve tank", "Run `shapechanger robot init`"),
    *((f"serve test-car.toml --{option}", f"--{needs} needs --twin") for option, needs in TWINS),
    ("serve test-car.toml --twin --port 99999", "A port must be"),
    ("serve test-car.toml --twin --port 0 --host 203.0.113.1", "Cannot listen at"),
    ("serve test-car.toml --twin --twin-folder nowhere", "There is no folder"),
    ("serve test-car.toml --twin --twin-folder stale", "A twin has left"),
    ("serve test-car.toml --twin --policy nowhere", "There is no policy file or folder"),
    ("serve test-car.toml --twin --port 0 --world coridor", "Did you mean 'corridor'?"),
    ("serve test-car.toml --twin --port 0 --world room --lens dirt", "choose another --world"),
    ("serve test-car.toml --twin --port 0 --lens nihgt", "Did you mean 'night'?"),
    ("serve finger --twin --port 0 --lens dirt", "No vehicle matches 'finger'"),
    ("serve cat --twin --port 0 --world corridor", "there is no cat in MuJoCo"),
    ("serve car --twin --port 0 --world harbour", "A car does not float"),
    ("serve finger --twin --port 0 --finger-seed 3", "--finger-seed needs --gap"),
    ("serve finger --twin --port 0 --gap real-lik", "Did you mean 'real-like'?"),
    ("serve finger --twin --port 0 --gap wide --world room", "Give --gap or --world, not both"),
    ("serve test-car.toml --twin --port 0 --gap wide", "--gap must be used with a finger"),
    ("serve test-car.toml --twin --seed -1", "A seed must be a whole number from 0 to"),
    ("check test-car.toml", "lift its wheels"),
    ("check test-car.toml --cap 0", "--cap must be above 0"),
    ("check test-car.toml --wiring --cap 0.5", "--cap needs a check that drives"),
    ("check test-car.toml --faults --trials 0", "--trials must be at least 1"),
    ("check test-car.toml --faults --leds", "Choose one of --leds and --faults"),
    ("check test-car.toml --yes", "--yes needs --leds"),
    ("check test-car.toml --twin --leds --probe 20", "A twin needs no --probe"),
    ("check test-car.toml --leds --probe 40", "GPIO0 to GPIO27, got 40"),
    ("check finger --twin --leds", "which LEDs cannot replace"),
    ("check finger --faults", "there is nothing to stop"),
    ("check test-car.toml --no-one-shot", "--no-one-shot needs --faults"),
    ("check test-car.toml --twin --jumper 20 21", "--jumper cannot be combined with --twin"),
    ("check test-car.toml --leds --wheels-up", "--wheels-up cannot be combined with --twin"),
    ("check test-car.toml --wheels-up --jumper 20 20", "A jumper joins two pins"),
    ("install car", "`shapechanger robot init car` writes your own"),
    ("calibrate finger --zeros", "`shapechanger robot init finger` writes your own"),
    ("calibrate test-car.toml --zeros --straight", "no tendons on a servo bus"),
    ("calibrate test-car.toml", "lift its wheels"),
    ("calibrate car", "`shapechanger robot init car` writes your own"),
    ("calibrate test-car.toml --cap 2", "--cap must be above 0"),
    ("calibrate test-car.toml --twin", "needs a terminal"),
    ("drive nobody", "No known robot matches 'nobody'"),
    ("key test-cat", "Did you mean 'test-car'?"),
    ("key test-car --credentials nowhere", "nowhere/key does not exist"),
    ("stop nobody", "No known robot matches 'nobody'"),
    ("remember one 127.0.0.1 --fingerprint zz", "64 hexadecimal digits"),
    ("remember ../one 127.0.0.1 --fingerprint insecure", "name must have 1 to 64"),
    ("find --seconds 0", "must be above 0 and at most 60"),
)


@pytest.mark.parametrize(("command", "text"), MISTAKES)
def test_a_mistake_gives_one_sentence(
    robot: Cli, home: Path, monkeypatch: pytest.MonkeyPatch, command: str, text: str
) -> None:
    monkeypatch.setenv("SHAPECHANGER_KEY", KEY)
    write_ready_profile(home)
    (home / "work" / "twice.toml").write_text(changed("pins = [13, 12]", "pins = [22, 12]"))
    (home / "work" / "stale").mkdir()
    (home / "work" / "stale" / "ledger.jsonl").touch()
    before = files(home)
    assert text in robot.refused(*command.split())
    assert files(home) == before


def test_remember_requires_the_key(robot: Cli) -> None:
    command = ("remember", "one", "127.0.0.1", "--fingerprint", "insecure")
    assert "SHAPECHANGER_KEY" in robot.refused(*command)


def test_a_port_in_use_is_refused(robot: Cli, home: Path) -> None:
    path = write_ready_profile(home)
    before = files(home / "work")
    with socket.create_server(("127.0.0.1", 0)) as other:
        options = ("--twin", "--port", other.getsockname()[1], "--no-announce", *IN_A_ROOM)
        assert "Is the robot served already?" in robot.refused("serve", path, *options)
    assert files(home / "work") == before


def test_a_twin_on_another_clock_is_refused(robot: Cli, home: Path) -> None:
    path, folder = write_ready_profile(home), home / "work" / "twin"
    folder.mkdir()
    with start_board(load_profile(path).guard_plan(), "real", folder):
        options = ("--twin", "--port", "0", "--no-announce", "--twin-folder", folder, *IN_A_ROOM)
        told = robot.refused("serve", path, *options, "--clock", "twin")
    assert "runs on --clock real" in told


def test_init_never_overwrites(robot: Cli, home: Path) -> None:
    """Profile and key are kept; another profile with the same robot's name has the same key."""
    output = robot.output("init", "car", "--name", "rover")
    key = next(line.split()[1] for line in output.splitlines() if line.startswith("key  "))
    profile = home / "work" / "rover.toml"
    profile.write_text(profile.read_text() + "# Mine.\n")
    before = {path: path.read_bytes() for path in home.rglob("*") if path.is_file()}
    assert "it exists" in robot.refused("init", "car", "--name", "rover")
    profile.rename(profile.with_name("other.toml"))
    assert key in robot.output("init", "car", "--name", "rover")
    profile.with_name("other.toml").replace(profile)
    assert {path: path.read_bytes() for path in before} == before


def test_the_key_can_be_shown_again(robot: Cli, home: Path) -> None:
    made = robot.output("init", "car", "--name", "rover")
    output = robot.output("key", "rover")
    assert all(part in made for part in output.strip().split("\n\n"))
    known = tomllib.loads((home / "config" / "shapechanger" / "known" / "rover.toml").read_text())
    assert f"key          {known['key']}\n" in output
    assert f"fingerprint  {known['fingerprint']}\n" in output
    assert "shapechanger robot remember rover " in output


@WITHOUT_PINS
def test_a_profile_in_the_current_folder_is_found_by_its_name(robot: Cli, home: Path) -> None:
    """A shipped profile of the same name takes precedence."""
    write_ready_profile(home)
    wiring = ("--wiring", "--port", "0")
    output = robot.ended(1, "check", "test-car", *wiring).out
    assert "good  profile: test-car.toml is valid" in output
    (home / "work" / "car.toml").write_text("broken")
    assert "shipped" in robot.ended(1, "check", "car", *wiring).out


def test_stopping_a_robot_that_is_off(robot: Cli, monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.create_server(("127.0.0.1", 0)) as unused:
        address = f"127.0.0.1:{unused.getsockname()[1]}"
    monkeypatch.setenv("SHAPECHANGER_KEY", KEY)
    robot.output("remember", "off", address, "--fingerprint", "ab" * 32)
    ended = robot.ended(1, "stop", "off")
    assert ended.out == ""
    assert "The stop was not confirmed" in ended.err


@WITHOUT_PINS
@pytest.mark.parametrize("command", ["serve", "check --leds"])
def test_a_machine_without_pins(robot: Cli, home: Path, command: str) -> None:
    name, *options = command.split()
    assert "serve --twin" in robot.refused(name, write_ready_profile(home), *options)


@WITHOUT_PINS
def test_safe_pins_on_a_machine_without_pins(
    home: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for arguments, message in (([write_ready_profile(home)], "serve --twin"), ([], "Give the")):
        with pytest.raises(SystemExit) as ended:
            safe_pins.main(arguments)
        assert ended.value.code == 2
        assert message in capsys.readouterr().err


def test_a_full_disk_leaves_no_partial_robot(
    robot: Cli, home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real, left = os.fsync, 0

    def fsync(fd: int) -> None:
        nonlocal left
        left -= 1
        if left < 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        real(fd)

    monkeypatch.setattr("os.fsync", fsync)
    for first in (0, 1, 2, 3, 1):  # Complete files of earlier attempts are kept.
        left = first
        assert "No space left" in robot.refused("init", "car", "--name", "rover")
        assert not (home / "work" / "rover.toml").exists()
        assert all(path.stat().st_size for path in home.rglob("*") if path.is_file())
        assert not list(home.rglob(".*"))
    left = 99
    robot.output("init", "car", "--name", "rover")


def test_a_broken_file_of_a_known_robot_is_skipped(
    robot: Cli, home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = FoundRobot("rover", "car", Address("192.0.2.1", 5000), "ab" * 32, "1")
    monkeypatch.setattr("shapechanger.cli.robot.remote.find", lambda _: [found])
    monkeypatch.setenv("SHAPECHANGER_KEY", KEY)
    robot.output("remember", "mine", "192.0.2.1", "--fingerprint", "ab" * 32)
    broken = home / "config" / "shapechanger" / "known" / "broken.toml"
    broken.write_text("key = ")
    broken.chmod(0o600)
    ended = robot.ended(0, "find")
    assert "mine" in ended.out
    assert ended.err.startswith("broken is skipped: ")
    assert ended.err.count("\n") == 1


def test_questions_are_repeated(monkeypatch: pytest.MonkeyPatch) -> None:
    answers = iter(["", "maybe", "Y", "n"])

    def answer() -> str:
        try:
            return next(answers)
        except StopIteration:
            raise EOFError from None

    monkeypatch.setattr("builtins.input", answer)
    assert [ask_person("Is it lit?") for _ in range(3)] == [True, False, None]
