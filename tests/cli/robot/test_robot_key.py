"""`shapechanger robot key`."""

from pathlib import Path

import pytest
import segno

from shapechanger.cli import main
from shapechanger.robot.daemon.credentials import credentials_folder, make_credentials

# The upper and the lower half of a character, light for ink.
_HALVES = {"█": (0, 0), "▀": (0, 1), "▄": (1, 0), " ": (1, 1)}


def test_the_qr_code_holds_the_console_address(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The key is in the fragment of the URL, which browsers do not send."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    made = make_credentials(credentials_folder("car"), "car")
    main(["robot", "key", "car", "--qr", "--address", "192.168.0.7"])
    output = capsys.readouterr().out
    assert "https://192.168.0.7:5000/" in output
    drawn = [[_HALVES[c] for c in line] for line in output.splitlines() if set(line) & {"█", "▀"}]
    rows = [[pair[half] for pair in line] for line in drawn for half in (0, 1)]
    key = made.key_file.read_text().strip()
    expected = segno.make(f"https://192.168.0.7:5000/#key={key}", micro=False)
    border = (len(rows[0]) - len(expected.matrix)) // 2
    inside = [row[border : border + len(expected.matrix)] for row in rows]
    assert inside[border : border + len(expected.matrix)] == [list(r) for r in expected.matrix]
