"""`shapechanger robot drive` opens the console in a browser, which alone gets the key."""

import sys
import webbrowser
from pathlib import Path

import pytest

from shapechanger.cli import main
from shapechanger.errors import LinkError
from shapechanger.robot.client import known_robots as opening
from shapechanger.robot.client.known_robots import KnownRobot, can_open, open_console, remember
from shapechanger.robot.link.authentication import new_key
from shapechanger.robot.twin.robot import run_robot
from tests.robots import IN_A_ROOM, PATIENT_CAR, write_profile

pytestmark = pytest.mark.realtime

# Fake browser: stores the given page, its path and its file mode.
_BROWSER = """\
import os, pathlib, sys, urllib.parse
page = pathlib.Path(urllib.parse.urlparse(sys.argv[2]).path)
out = pathlib.Path(sys.argv[1])
out.write_text(f"{os.stat(page).st_mode & 0o777:o} {page} {page.read_text()}")
"""


@pytest.fixture
def opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The file in which the fake browser stores its page."""
    script, out = tmp_path / "browser.py", tmp_path / "opened.txt"
    script.write_text(_BROWSER)
    monkeypatch.setenv("BROWSER", f"{sys.executable} {script} {out} %s")
    monkeypatch.setenv("DISPLAY", ":99")
    # The command waits for a new access time of the page, which not every file system records. Wait
    # briefly, because the fake browser has read the page before it exits.
    monkeypatch.setattr(opening, "_OPENED_WITHIN_S", 0.1)
    return out


def test_drive_opens_the_console_with_its_key(
    tmp_path: Path,
    opened: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The key is neither printed nor left in a readable file."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    with run_robot(write_profile(tmp_path, PATIENT_CAR), arguments=IN_A_ROOM) as robot:
        known = robot.known
        remember(KnownRobot("car", known.address, known.key, known.fingerprint))
        main(["robot", "drive", "car"])
    mode, page, content = opened.read_text().split(" ", 2)
    assert mode == "600"
    assert f"https://{known.address}/#key={known.key}" in content
    assert not Path(page).exists()
    output = capsys.readouterr().out
    assert f"https://{known.address}/" in output
    assert known.key not in output


def test_without_a_display_nothing_is_opened(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert can_open() == (sys.platform == "darwin")


def test_a_browser_failure_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(webbrowser, "open", lambda *_: False)
    robot = KnownRobot("car", "127.0.0.1:5000", new_key(), "insecure")
    with pytest.raises(LinkError, match=r"open http://127\.0\.0\.1:5000/ in one, or .*--terminal"):
        open_console(robot)
