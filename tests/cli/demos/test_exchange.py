"""`shapechanger demos import` and `export`."""

from __future__ import annotations

from pathlib import Path

import pytest

from shapechanger.cli.demos.recordings import Export, Import
from shapechanger.demos.episodes import drop
from shapechanger.errors import UnknownName
from tests.demos.exchange.small import drive, keys_folder


def test_import_says_what_came(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The format that was found, and how much there was."""
    Import(keys_folder(tmp_path / "keys"), tmp_path / "data").run()
    assert capsys.readouterr().out == (
        f"read {tmp_path / 'keys'} (2017): 1 episode, 3 steps, 3 pictures\n"
        f"wrote {tmp_path / 'data'}\n"
    )


def test_export_says_what_stayed_and_how_to_load(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Dropped steps stay, and Minari wants to be told where to look."""
    path = drive(tmp_path / "data")
    drop(path, 1, 2, "bad")
    Export(tmp_path / "data", tmp_path / "sets/drive-v0", "minari").run()
    said = capsys.readouterr().out
    assert "3 steps of 1 episode\n" in said
    assert "left out 2 dropped steps; --dropped includes them" in said
    assert f"MINARI_DATASETS_PATH={tmp_path / 'sets'}" in said
    assert "minari.load_dataset('drive-v0')" in said
    Export(tmp_path / "data", tmp_path / "csv", "csv", dropped=True).run()
    assert "5 steps of 1 episode\n" in capsys.readouterr().out


def test_a_word_that_is_no_format(tmp_path: Path) -> None:
    """The nearest one is told."""
    with pytest.raises(UnknownName, match="Did you mean 'minari'"):
        Export(drive(tmp_path / "data"), tmp_path / "out", "mniari").run()
