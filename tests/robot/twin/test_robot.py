"""Log and folder of a robot whose link is lost."""

import subprocess
import sys
from pathlib import Path

import pytest

from shapechanger.errors import LinkError
from shapechanger.robot.twin.robot import RunningRobot

_WAIT = "import signal; signal.pause()"


def test_a_lost_link_keeps_the_end_of_the_log(tmp_path: Path) -> None:
    """The error has the end of the log, because closing removes a temporary folder and its log."""
    folder = tmp_path / "robot"
    folder.mkdir()
    (folder / "ready.json").write_text('{"port": 1, "fingerprint": ""}')
    (folder / "log.txt").write_text("x" * 5000 + "guard: the daemon has ended")
    supervisor = subprocess.Popen([sys.executable, "-c", _WAIT])
    with pytest.raises(LinkError) as raised, RunningRobot(folder, supervisor, temporary=True):
        raise LinkError("It is lost.")
    assert not folder.exists()
    assert supervisor.returncode is not None
    (note,) = raised.value.__notes__
    assert note.startswith("The log of the robot ends:\nx")
    assert note.endswith("guard: the daemon has ended")
