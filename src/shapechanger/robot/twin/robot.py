"""Serve a robot by processes on this machine."""

from __future__ import annotations

import ctypes
import json
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, Final, Literal, Self

from shapechanger.errors import LinkError, RobotError
from shapechanger.robot.client.client import RobotClient
from shapechanger.robot.client.known_robots import KnownRobot
from shapechanger.robot.daemon.credentials import make_credentials
from shapechanger.robot.profile.load import load_profile
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.twin.operator import Operator as Operator
from shapechanger.robot.twin.start import BoardAt, end

_READY: Final = "ready.json"  # File that the daemon writes when it can be reached.
_PR_SET_PDEATHSIG: Final = 1  # linux/prctl.h
_READY_S: Final = 60.0
_END_S: Final = 10.0
_POLL_S: Final = 0.02
_LOG: Final = 2000  # Length of the end of a log in error notes, characters.


class RunningRobot:
    """A robot that is served by processes on this machine until `close`.

    Args:
        temporary: Whether `close` removes the folder.

    Attributes:
        folder: Folder of the robot's files: the twin's ledger and socket, the key and the log.
        supervisor: Process of the robot's supervisor.

    Raises:
        RobotError: If the robot does not start.
    """

    def __init__(
        self, folder: Path, supervisor: subprocess.Popen[bytes], *, temporary: bool = False
    ) -> None:
        self.folder = folder
        self.supervisor = supervisor
        self._temporary = temporary
        self.await_restart()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, _: object, error: BaseException | None, __: object) -> None:
        """Close the robot; add the end of its log to a `LinkError` as a note."""
        if isinstance(error, LinkError):
            error.add_note(f"The log of the robot ends:\n{self.log_text()[-_LOG:]}")
        self.close()

    @property
    def port(self) -> int:
        """Port on 127.0.0.1, once the daemon can be reached; see `await_restart`."""
        return int(self.await_restart()["port"])

    @property
    def ledger_path(self) -> Path:
        """Ledger of the twin."""
        return BoardAt(self.folder).ledger_path

    @property
    def known(self) -> KnownRobot:
        """Address and credentials of the robot."""
        return self.known_at(f"127.0.0.1:{self.port}")

    def known_at(self, address: str) -> KnownRobot:
        """Return the credentials with another address, such as the address of a proxy."""
        key = (self.folder / "credentials" / "key").read_text().strip()
        return KnownRobot("robot", address, key, self.await_restart()["fingerprint"] or "insecure")

    def client(self, **options: Any) -> RobotClient:
        """Connect to the robot, with options of `RobotClient.connect`."""
        return RobotClient.connect(self.known, **options)

    def operator(self) -> Operator:
        """Connect an operator to the robot's twin."""
        return Operator(BoardAt(self.folder).socket_path)

    def pid_of(self, program: Literal["guard", "daemon"]) -> int:
        """Return the process id of a program of the robot.

        Raises:
            RobotError: If the program does not run at the moment.
        """
        parent = self.supervisor.pid
        children = Path(f"/proc/{parent}/task/{parent}/children").read_text().split()
        for pid in children:
            arguments = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
            if any(a.decode().endswith((program, f"robot.{program}.process")) for a in arguments):
                return int(pid)
        raise RobotError(f"The robot's {program} does not run at the moment.")

    def log_text(self) -> str:
        """Return the log of the robot's processes so far."""
        path = self.folder / "log.txt"
        return path.read_text(errors="replace") if path.exists() else ""

    def await_restart(self) -> dict[str, Any]:
        """Wait until the daemon can be reached; after `forget_ready`, until it has restarted.

        Returns:
            The "port" of the daemon, and the "fingerprint" of its certificate.

        Raises:
            RobotError: If the daemon does not start in time.
        """
        path = self.folder / _READY
        until_s = time.monotonic() + _READY_S
        while not path.exists():
            if self.supervisor.poll() is not None or time.monotonic() > until_s:
                self._end()
                text = self.log_text().strip()
                self.close()
                raise RobotError(f"The robot did not start: {text}")
            time.sleep(_POLL_S)
        return json.loads(path.read_text())

    def forget_ready(self) -> None:
        """Remove the daemon's ready file, before an action that restarts the daemon."""
        (self.folder / _READY).unlink(missing_ok=True)

    def close(self) -> None:
        """End the robot's processes, with its outputs at rest."""
        self._end()
        if self._temporary:
            # The board may still write the last lines of its ledger.
            shutil.rmtree(self.folder, ignore_errors=True)

    def _end(self) -> None:
        if self.supervisor.poll() is None:
            self.supervisor.send_signal(signal.SIGCONT)
            self.supervisor.terminate()
        end(self.supervisor, _END_S)


def run_robot(
    profile: Profile | Path,
    *,
    twin: bool = True,
    clock: Literal["real", "twin"] = "real",
    seed: int = 0,
    folder: Path | None = None,
    arguments: tuple[str, ...] = (),
) -> RunningRobot:
    """Serve a robot on a free port of 127.0.0.1, as `shapechanger robot serve` does.

    Args:
        profile: Profile of the robot, or its file.
        twin: Whether to serve it on its twin.
        clock: Clock of a twin: the machine's clock ("real"), or one that only clients advance.
        seed: Seed of a twin's world.
        folder: Folder of the robot's files, and of a running twin's board; None for a new one.
        arguments: Further arguments of `shapechanger robot serve`.

    Raises:
        RobotError: If the robot does not start.
    """
    if not isinstance(profile, Profile):
        profile = load_profile(profile)
    temporary = folder is None
    folder = folder or Path(tempfile.mkdtemp(prefix="shapechanger-robot-"))
    make_credentials(folder / "credentials", profile.name)
    command = [sys.executable, "-m", "shapechanger", "robot", "serve", str(profile.path)]
    command += ["--port", "0", "--no-announce", "--host", "127.0.0.1"]
    command += ["--credentials", str(folder / "credentials")]
    command += ["--ready-file", str(folder / _READY)]
    command += ["--recordings", str(folder / "recordings"), *arguments]
    if twin:
        command += ["--twin", "--clock", clock, "--seed", str(seed), "--twin-folder", str(folder)]
    with (folder / "log.txt").open("wb") as log:
        supervisor = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=log,
            # Ctrl-C must reach only the driving program, which then ends the robot.
            process_group=0,
            # The robot must end with this process. The setting survives `exec`.
            preexec_fn=lambda: ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM),
        )
    return RunningRobot(folder, supervisor, temporary=temporary)
