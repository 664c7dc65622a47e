"""The folder of a robot's recordings."""

from __future__ import annotations

from pathlib import Path

import pytest

from shapechanger.errors import RobotError
from shapechanger.robot.serve import recordings_folder


def test_it_follows_the_xdg_specification(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The folder is below XDG_DATA_HOME, if that is absolute."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("XDG_DATA_HOME", raising=False)
    home = tmp_path / ".local/share/shapechanger/recordings/car"
    assert recordings_folder("car") == home
    monkeypatch.setenv("XDG_DATA_HOME", "relative")
    assert recordings_folder("car") == home
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    assert recordings_folder("car") == tmp_path / "data/shapechanger/recordings/car"


@pytest.mark.parametrize("name", ["", "..", "a/b", ".car", "a\0b"])
def test_invalid_names_are_refused(name: str) -> None:
    """The name must be a single folder name."""
    with pytest.raises(RobotError, match="folder"):
        recordings_folder(name)
