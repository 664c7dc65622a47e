"""A robot that is served in processes of its own, for as long as somebody needs it."""

from __future__ import annotations

import contextlib
import ctypes
import json
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Final, Literal, Self

from shapechanger.errors import RobotError
from shapechanger.remote.client import RobotClient
from shapechanger.remote.known_robots import KnownRobot
from shapechanger.robot.daemon.credentials import make_credentials
from shapechanger.robot.profile.load import load_profile
from shapechanger.robot.profile.profile import Profile
from shapechanger.twin.operator import Operator

__all__ = ["RunningRobot", "run_robot"]

_READY: Final = "ready.json"
_PR_SET_PDEATHSIG: Final = 1  # linux/prctl.h
_READY_S: Final = 60.0
_END_S: Final = 10.0
_LOOK_S: Final = 0.02


@dataclass(frozen=True, slots=True)
class _Ready:
    """What the daemon says once it can be reached."""

    port: int
    fingerprint: str


class RunningRobot:
    """A robot that is served on this machine; it ends with `close`.

    Args:
        folder: Where its files are.
        supervisor: Its supervisor.
        temporary: Whether the folder goes away with it.

    Attributes:
        folder: Where its files are: the twin's ledger and socket, the key and what it said.
        supervisor: Its supervisor.
    """

    def __init__(
        self, folder: Path, supervisor: subprocess.Popen[bytes], *, temporary: bool = False
    ) -> None:
        self.folder = folder
        self.supervisor = supervisor
        self._temporary = temporary
        self._ready = self._await_ready()

    def __enter__(self) -> Self:
        """The robot itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """End it."""
        self.close()

    @property
    def port(self) -> int:
        """Where it listens, on 127.0.0.1; another port after its processes started afresh."""
        if (self.folder / _READY).exists():
            self._ready = self._await_ready()
        return self._ready.port

    @property
    def ledger_path(self) -> Path:
        """The twin's ledger."""
        return self.folder / "ledger.jsonl"

    @property
    def known(self) -> KnownRobot:
        """What it takes to reach it."""
        return self.known_at(f"127.0.0.1:{self.port}")

    def known_at(self, address: str) -> KnownRobot:
        """The same robot behind another address, such as that of a proxy."""
        key = (self.folder / "credentials" / "key").read_text().strip()
        return KnownRobot("robot", address, key, self._ready.fingerprint or "insecure")

    def client(self, **options: Any) -> RobotClient:
        """A connection to it; options as `RobotClient.connect` takes them."""
        return RobotClient.connect(self.known, **options)

    def operator(self) -> Operator:
        """Somebody who stands beside its twin."""
        return Operator(str(self.folder / "board.socket"))

    def pid_of(self, program: Literal["guard", "daemon"]) -> int:
        """The process that runs a program of the robot.

        Raises:
            RobotError: If there is none at the moment.
        """
        parent = self.supervisor.pid
        children = Path(f"/proc/{parent}/task/{parent}/children").read_text().split()
        for pid in children:
            arguments = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
            if any(a.decode().endswith((program, f"robot.{program}")) for a in arguments):
                return int(pid)
        raise RobotError(f"The robot's {program} does not run at the moment.")

    def said(self) -> str:
        """What its processes said so far, for people to read."""
        path = self.folder / "log.txt"
        return path.read_text(errors="replace") if path.exists() else ""

    def await_restart(self, timeout_s: float = _READY_S) -> None:
        """Wait until its daemon can be reached again after a restart.

        Raises:
            RobotError: If that does not happen.
        """
        self._ready = self._await_ready(timeout_s)

    def forget_ready(self) -> None:
        """Take away what the daemon said, before something that makes it start again."""
        (self.folder / _READY).unlink(missing_ok=True)

    def close(self) -> None:
        """End it; its outputs are at rest then."""
        self._end()
        if self._temporary:
            # Its board may still write the last lines of its ledger there.
            shutil.rmtree(self.folder, ignore_errors=True)

    def _end(self) -> None:
        if self.supervisor.poll() is None:
            self.supervisor.send_signal(signal.SIGCONT)
            self.supervisor.terminate()
        try:
            self.supervisor.wait(_END_S)
        except subprocess.TimeoutExpired:
            self.supervisor.kill()
            self.supervisor.wait()

    def _await_ready(self, timeout_s: float = _READY_S) -> _Ready:
        path = self.folder / _READY
        until_s = time.monotonic() + timeout_s
        while not path.exists():
            if self.supervisor.poll() is not None or time.monotonic() > until_s:
                self._end()
                said = self.said().strip()
                self.close()
                raise RobotError(f"The robot did not start: {said}")
            time.sleep(_LOOK_S)
        return _Ready(**json.loads(path.read_text()))


def run_robot(
    profile: Profile | Path,
    *,
    twin: bool = True,
    clock: Literal["real", "twin"] = "real",
    seed: int = 0,
    folder: Path | None = None,
    log: IO[bytes] | None = None,
    arguments: tuple[str, ...] = (),
) -> RunningRobot:
    """Serve a robot on a free port of 127.0.0.1, as `shapechanger robot serve` does.

    Args:
        profile: The robot, or its file.
        twin: Whether on its twin.
        clock: Where a twin's time comes from.
        seed: Seed of a twin's world.
        folder: Folder for its files; one that goes away with it if not given. A twin that runs
            there is used.
        log: Where its processes say what happens; a file in the folder if not given.
        arguments: More arguments of `serve`.

    Raises:
        RobotError: If it does not start.
    """
    if not isinstance(profile, Profile):
        profile = load_profile(profile)
    temporary = folder is None
    folder = folder or Path(tempfile.mkdtemp(prefix="shapechanger-robot-"))
    make_credentials(folder / "credentials", profile.name)
    command = [sys.executable, "-c", "from shapechanger.cli import main; main()"]
    command += ["robot", "serve", str(profile.path), "--port", "0", "--no-announce"]
    command += ["--credentials", str(folder / "credentials")]
    command += ["--host", "127.0.0.1", "--ready-file", str(folder / "ready.json")]
    command += ["--recordings", str(folder / "recordings"), *arguments]
    if twin:
        command += ["--twin", "--clock", clock, "--seed", str(seed)]
        command += ["--twin-folder", str(folder)]
    with contextlib.ExitStack() as stack:
        said = log or stack.enter_context((folder / "log.txt").open("wb"))
        supervisor = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=said,
            stderr=said,
            # So that Ctrl-C reaches whoever drives first, who then ends the robot.
            process_group=0,
            preexec_fn=_end_with_parent if sys.platform == "linux" else None,
        )
    return RunningRobot(folder, supervisor, temporary=temporary)


def _end_with_parent() -> None:
    """Let the kernel end this process when whoever started it is gone, however that came.

    A robot must not run on because a terminal was closed. The request outlives `exec`.
    """
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
