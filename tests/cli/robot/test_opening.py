"""`shapechanger robot drive` opens the console, and the key goes to the browser alone."""

from __future__ import annotations

import sys
import webbrowser
from pathlib import Path

import pytest

from shapechanger.cli import main
from shapechanger.cli.robot import key as opening
from shapechanger.cli.robot.key import can_open, open_console
from shapechanger.errors import LinkError
from shapechanger.link.authentication import new_key
from shapechanger.remote.known_robots import KnownRobot, remember
from shapechanger.twin.robot import run_robot
from tests.robots import IN_A_ROOM, PATIENT_CAR, write_profile

pytestmark = pytest.mark.realtime

# Stands in for a browser: keeps what it was given, and who may read it.
_BROWSER = """\
import os, pathlib, sys, urllib.parse
page = pathlib.Path(urllib.parse.urlparse(sys.argv[2]).path)
out = pathlib.Path(sys.argv[1])
out.write_text(f"{os.stat(page).st_mode & 0o777:o} {page} {page.read_text()}")
"""


@pytest.fixture
def opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The file in which the browser of this test keeps what it was given."""
    script, out = tmp_path / "browser.py", tmp_path / "opened.txt"
    script.write_text(_BROWSER)
    monkeypatch.setenv("BROWSER", f"{sys.executable} {script} {out} %s")
    monkeypatch.setenv("DISPLAY", ":99")
    # This browser has read the page when it ends; not every file system tells that.
    monkeypatch.setattr(opening, "_OPENED_WITHIN_S", 0.1)
    return out


def test_drive_opens_the_console_with_its_key(
    tmp_path: Path,
    opened: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Nobody else can read the key: not in the address that is printed, nor in a file."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    with run_robot(write_profile(tmp_path, PATIENT_CAR), arguments=IN_A_ROOM) as robot:
        known = robot.known
        remember(KnownRobot("car", known.address, known.key, known.fingerprint))
        main(["robot", "drive", "car"])
    mode, page, content = opened.read_text().split(" ", 2)
    assert mode == "600"
    assert f"https://{known.address}/#key={known.key}" in content
    assert not Path(page).exists()
    said = capsys.readouterr().out
    assert f"https://{known.address}/" in said
    assert known.key not in said


def test_without_a_screen_there_is_nothing_to_open(monkeypatch: pytest.MonkeyPatch) -> None:
    """The terminal drives then."""
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert can_open() == (sys.platform == "darwin")


def test_a_browser_that_fails_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """With the address to open by hand, and the way that needs no browser."""
    monkeypatch.setattr(webbrowser, "open", lambda *_: False)
    robot = KnownRobot("car", "127.0.0.1:5000", new_key(), "insecure")
    with pytest.raises(LinkError, match=r"open http://127\.0\.0\.1:5000/ in one, or .*--terminal"):
        open_console(robot)
