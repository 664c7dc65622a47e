"""What `shapechanger robot key` shows of a robot of this machine."""

from __future__ import annotations

from pathlib import Path

import pytest
import segno

from shapechanger.cli import main
from shapechanger.robot.daemon.credentials import credentials_folder, make_credentials

# The upper and the lower half of a character, light where there is ink.
_HALVES = {"█": (0, 0), "▀": (0, 1), "▄": (1, 0), " ": (1, 1)}


def test_a_phone_finds_the_console_by_the_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is the QR code of the console's address, with the key where no browser sends it."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    made = make_credentials(credentials_folder("car"), "car")
    main(["robot", "key", "car", "--qr", "--address", "192.168.0.7"])
    said = capsys.readouterr().out
    assert "https://192.168.0.7:5000/" in said
    drawn = [[_HALVES[c] for c in line] for line in said.splitlines() if set(line) & {"█", "▀"}]
    rows = [[pair[half] for pair in line] for line in drawn for half in (0, 1)]
    key = made.key_file.read_text().strip()
    expected = segno.make(f"https://192.168.0.7:5000/#key={key}", micro=False)
    border = (len(rows[0]) - len(expected.matrix)) // 2
    inside = [row[border : border + len(expected.matrix)] for row in rows]
    assert inside[border : border + len(expected.matrix)] == [list(r) for r in expected.matrix]
