"""Served twins become known robots, but do not replace other known robots."""

from dataclasses import replace
from pathlib import Path

import pytest
import segno

from shapechanger.cli import main
from shapechanger.robot.client.known_robots import KnownRobot, known_folder, recall, remember
from shapechanger.robot.daemon.credentials import credentials_folder, make_credentials
from shapechanger.robot.link.authentication import new_key
from shapechanger.robot.serve import store

_MINE = KnownRobot("rover", "127.0.0.1", new_key(), "ab" * 32)


@pytest.fixture(autouse=True)
def _home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))


def test_a_new_robot_is_remembered() -> None:
    message = store(_MINE)
    assert recall("rover") == _MINE
    assert message == "Known here as rover: `shapechanger robot drive rover` drives it from here."
    assert store(replace(_MINE, address="127.0.0.1:5000")) == message


def test_the_address_of_a_known_robot_is_updated() -> None:
    remember(_MINE)
    moved = replace(_MINE, address="127.0.0.1:5001")
    assert "now at 127.0.0.1:5001 instead of 127.0.0.1:5000" in store(moved)
    assert recall("rover") == moved


@pytest.mark.parametrize(
    "changes",
    [{"key": new_key()}, {"fingerprint": "cd" * 32}, {"address": "rover.local"}],
    ids=["key", "fingerprint", "address"],
)
def test_another_robot_of_the_same_name_is_kept(changes: dict[str, str]) -> None:
    """Serving a twin does not overwrite the key of a real robot."""
    remember(other := replace(_MINE, **changes))
    assert "stays" in store(_MINE)
    assert recall("rover") == other


def test_a_file_that_cannot_be_read_is_left_alone() -> None:
    """The file may hold the only copy of a key."""
    remember(_MINE)
    path = known_folder() / "rover.toml"
    path.write_text("key = ")
    assert store(_MINE).startswith("It is not stored as a known robot: ")
    assert path.read_text() == "key = "


# Upper and lower half of a character: 0 for a light module of the code, 1 for a dark one.
_HALVES = {"█": (0, 0), "▀": (0, 1), "▄": (1, 0), " ": (1, 1)}


def test_the_qr_code_holds_the_console_address(capsys: pytest.CaptureFixture[str]) -> None:
    """The key is in the fragment of the URL, which browsers do not send."""
    made = make_credentials(credentials_folder("car"), "car")
    main(["robot", "key", "car", "--qr", "--address", "192.168.0.7"])
    output = capsys.readouterr().out
    assert "https://192.168.0.7:5000/" in output
    drawn = [[_HALVES[c] for c in line] for line in output.splitlines() if set(line) & {"█", "▀"}]
    rows = [[pair[half] for pair in line] for line in drawn for half in (0, 1)]
    expected = segno.make(f"https://192.168.0.7:5000/#key={made.key}", micro=False)
    border = (len(rows[0]) - len(expected.matrix)) // 2
    inside = [row[border : border + len(expected.matrix)] for row in rows]
    assert inside[border : border + len(expected.matrix)] == [list(r) for r in expected.matrix]
