"""`shapechanger demos import` and `export`."""

from __future__ import annotations

from pathlib import Path

import pytest

from shapechanger.cli.demos.recordings import Export, Import
from shapechanger.demos.episodes import drop
from shapechanger.errors import UnknownName
from tests.demos.exchange.small import drive, keys_folder


def test_import_prints_a_summary(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Format, episodes, steps and images."""
    Import(keys_folder(tmp_path / "keys"), tmp_path / "data").run()
    assert capsys.readouterr().out == (
        f"read {tmp_path / 'keys'} (2017): 1 episode, 3 steps, 3 pictures\n"
        f"wrote {tmp_path / 'data'}\n"
    )


def test_export_prints_a_summary_and_how_to_load(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Dropped steps are counted, and the Minari path is given."""
    path = drive(tmp_path / "data")
    drop(path, 1, 2, "bad")
    Export(tmp_path / "data", tmp_path / "sets/drive-v0", "minari").run()
    output = capsys.readouterr().out
    assert "3 steps of 1 episode\n" in output
    assert "left out 2 dropped steps; --dropped includes them" in output
    assert f"MINARI_DATASETS_PATH={tmp_path / 'sets'}" in output
    assert "minari.load_dataset('drive-v0')" in output
    Export(tmp_path / "data", tmp_path / "csv", "csv", dropped=True).run()
    assert "5 steps of 1 episode\n" in capsys.readouterr().out


def test_an_unknown_format(tmp_path: Path) -> None:
    """The error suggests the nearest format."""
    with pytest.raises(UnknownName, match="Did you mean 'minari'"):
        Export(drive(tmp_path / "data"), tmp_path / "out", "mniari").run()


def test_lerobot_and_mcap(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """How to load a LeRobot dataset is printed, and what takes dropped steps."""
    drop(drive(tmp_path / "data"), 0, 0, "bad")
    Export(tmp_path / "data", tmp_path / "set", "lerobot", task="Drive.", images=True).run()
    output = capsys.readouterr().out
    assert "4 steps of 1 episode\nleft out 1 dropped steps\n" in output
    assert f"LeRobotDataset('set', root='{tmp_path / 'set'}')" in output
    Import(tmp_path / "set", tmp_path / "back", camera="camera").run()
    assert "(lerobot): 1 episode, 4 steps, 4 pictures" in capsys.readouterr().out
    Export(tmp_path / "data", tmp_path / "logs", "mcap").run()
    assert "left out 1 dropped steps; --dropped includes them" in capsys.readouterr().out
