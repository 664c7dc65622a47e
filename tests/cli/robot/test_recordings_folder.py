"""Where a robot keeps what it records."""

from __future__ import annotations

from pathlib import Path

import pytest

from shapechanger.cli.robot.serve import recordings_folder
from shapechanger.errors import RobotError


def test_it_is_below_the_folder_for_data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By the XDG base directory specification, as the credentials are below that for settings."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("XDG_DATA_HOME", raising=False)
    home = tmp_path / ".local/share/shapechanger/recordings/car"
    assert recordings_folder("car") == home
    monkeypatch.setenv("XDG_DATA_HOME", "relative")
    assert recordings_folder("car") == home
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    assert recordings_folder("car") == tmp_path / "data/shapechanger/recordings/car"


@pytest.mark.parametrize("name", ["", "..", "a/b", ".car", "a\0b"])
def test_a_name_leads_nowhere_else(name: str) -> None:
    """It is that of a folder."""
    with pytest.raises(RobotError, match="folder"):
        recordings_folder(name)
