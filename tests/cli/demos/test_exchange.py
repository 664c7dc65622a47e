"""`shapechanger demos import` and `export`."""

from __future__ import annotations

from pathlib import Path

import pytest

from shapechanger.cli import main
from shapechanger.cli.demos.recordings import DemosExport, DemosImport
from shapechanger.demos.episodes import Drop, edit
from tests.cli.running import Cli
from tests.demos.exchange.small import drive, keys_folder, tub_folder


def test_import_prints_a_summary(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    DemosImport(keys_folder(tmp_path / "keys"), tmp_path / "data").run()
    assert capsys.readouterr().out == (
        f"read {tmp_path / 'keys'} (csv): 1 episode, 3 steps, 3 images\nwrote {tmp_path / 'data'}\n"
    )


def test_a_partial_import_has_an_exit_code_of_its_own(
    tmp_path: Path, demos: Cli, capsys: pytest.CaptureFixture[str]
) -> None:
    """0 for all, 3 for a part, 2 for nothing; findings are on the standard error."""
    records = [
        {"user/angle": 0.0, "user/throttle": 0.0, "_timestamp_ms": 51 * n, "lap": 1}
        for n in range(30)
    ]
    tub = tub_folder(tmp_path / "tub", records)
    for n in (3, 5, 8, 9):
        (tub / f"images/{n}_cam_image_array_.jpg").write_bytes(b"")
    command = ["demos", "import", str(tub), "--out", str(tmp_path / "data")]
    sentence = demos.refused(*command[1:], "--strict")
    left_out = "left out: 4 records with an empty image: 3, 5, 8, and 1 more"
    assert f"is incomplete ({left_out})" in sentence
    assert not (tmp_path / "data").exists()
    with pytest.raises(SystemExit) as ended:
        main(command)
    assert ended.value.code == 3
    output = capsys.readouterr()
    assert "1 episode, 26 steps, 26 images" in output.out
    assert "note: Columns that are not imported: lap.\n" in output.out
    assert "which is taken to be 20 Hz; --hz states another rate.\n" in output.out
    assert output.err == "left out 4 records with an empty image: 3, 5, 8, and 1 more\n"
    with pytest.raises(SystemExit) as ended:
        main(["demos", "import", str(tub), "--out", str(tmp_path / "b"), "--hz", "10"])
    assert ended.value.code == 3
    assert "these times are left out" in capsys.readouterr().out


def test_export_prints_a_summary_and_how_to_load(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Dropped steps are counted, and the Minari path is given."""
    path = drive(tmp_path / "data")
    edit(path, Drop(1, 2, "bad"))
    DemosExport(tmp_path / "data", tmp_path / "sets/drive-v0", "minari").run()
    output = capsys.readouterr().out
    assert "3 steps of 2 episodes\n" in output
    assert "so episodes are split at 1 gap of excluded or missing steps" in output
    assert "left out 2 dropped steps; --dropped includes them" in output
    assert f"MINARI_DATASETS_PATH={tmp_path / 'sets'}" in output
    assert "minari.load_dataset('drive-v0')" in output
    DemosExport(tmp_path / "data", tmp_path / "csv", "csv", dropped=True).run()
    assert "5 steps of 1 episode\n" in capsys.readouterr().out


def test_lerobot_and_mcap(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """How to load a LeRobot dataset is printed, and what takes dropped steps."""
    edit(drive(tmp_path / "data"), Drop(0, 0, "bad"))
    DemosExport(tmp_path / "data", tmp_path / "set", "lerobot", task="Drive.", images=True).run()
    output = capsys.readouterr().out
    assert "4 steps of 1 episode\nleft out 1 dropped step\n" in output
    assert f"LeRobotDataset('set', root='{tmp_path / 'set'}')" in output
    DemosImport(tmp_path / "set", tmp_path / "back", camera="camera").run()
    assert "(lerobot): 1 episode, 4 steps, 4 images" in capsys.readouterr().out
    DemosExport(tmp_path / "data", tmp_path / "logs", "mcap").run()
    assert "left out 1 dropped step; --dropped includes them" in capsys.readouterr().out
