"""A twin that is served here is known here, and takes nobody's name."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from shapechanger.cli.robot.serve import make_known
from shapechanger.link.authentication import new_key
from shapechanger.remote.known_robots import KnownRobot, known_folder, recall, remember

_MINE = KnownRobot("rover", "127.0.0.1", new_key(), "ab" * 32)


@pytest.fixture(autouse=True)
def _home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))


def test_a_robot_that_nobody_knows_is_written_down() -> None:
    """And said to be, with the command that drives it; again changes nothing."""
    said = make_known(_MINE)
    assert recall("rover") == _MINE
    assert said == "Known here as rover: `shapechanger robot drive rover` drives it from here."
    assert make_known(replace(_MINE, address="127.0.0.1:5000")) == said


def test_the_same_robot_on_another_port_is_found_there() -> None:
    """Both addresses are said."""
    remember(_MINE)
    moved = replace(_MINE, address="127.0.0.1:5001")
    assert "now at 127.0.0.1:5001 and no more at 127.0.0.1:5000" in make_known(moved)
    assert recall("rover") == moved


@pytest.mark.parametrize(
    "other",
    [
        replace(_MINE, key=new_key()),
        replace(_MINE, fingerprint="cd" * 32),
        replace(_MINE, address="rover.local"),
    ],
    ids=["key", "fingerprint", "address"],
)
def test_another_robot_of_the_same_name_stays_known(other: KnownRobot) -> None:
    """Nobody loses the key of a real car because they served a twin."""
    remember(other)
    assert "stays" in make_known(_MINE)
    assert recall("rover") == other


def test_a_file_that_cannot_be_read_is_left_alone() -> None:
    """It may hold the only copy of a key."""
    remember(_MINE)
    path = known_folder() / "rover.toml"
    path.write_text("key = ")
    assert make_known(_MINE).startswith("It is not stored as a known robot: ")
    assert path.read_text() == "key = "
