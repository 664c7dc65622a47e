"""An operator of the twin: puts the vehicle back, breaks and presses things, lets time go by."""

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
from typing import IO, Any, Final, Literal, NamedTuple, Self

from shapechanger.errors import RobotError
from shapechanger.remote.client import RobotClient
from shapechanger.remote.known_robots import KnownRobot
from shapechanger.robot.daemon.credentials import make_credentials
from shapechanger.robot.profile.load import load_profile
from shapechanger.robot.profile.profile import Profile
from shapechanger.twin.board_client import Link
from shapechanger.twin.camera import CameraFault
from shapechanger.twin.chips import Magnet
from shapechanger.twin.rig import ServoFault
from shapechanger.twin.signals import Levels, Pulse, PwmChannel

__all__ = ["Operator", "RunningRobot", "Whereabouts", "run_robot"]


class Whereabouts(NamedTuple):
    """Where the vehicle really is.

    Attributes:
        x: In metres.
        y: In metres.
        heading: Radians from the x axis, counter-clockwise seen from above.
        speed: m/s along the heading.
        travelled_m: Metres that the wheels rolled, backward counts down.
        bumped: Whether something presses its bumper.
        distance_m: Free distance ahead of its nose.
        truth: What nobody on board knows, such as how far it came along the course, by name.
        t: When, in nanoseconds.
    """

    x: float
    y: float
    heading: float
    speed: float
    travelled_m: float
    bumped: bool
    distance_m: float
    truth: dict[str, float]
    t: int


class Operator:
    """A person beside the robot. What it asks is answered after all that was said before.

    Args:
        path: The socket at which the board listens.
    """

    def __init__(self, path: str) -> None:
        self._link = Link(path, "operator")

    def __enter__(self) -> Operator:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def place(self, seed: int) -> None:
        """Put the vehicle at the start that follows from this seed."""
        self._link.ask(op="place", seed=seed)

    def put_back(self) -> None:
        """Put a vehicle that ran into something back on the lane, at rest, from where it goes on.

        In the plain room, which has no lane, it is put at its start. Its truth counts on.
        """
        self._link.ask(op="put_back")

    def lay_out(self, seed: int) -> None:
        """Put other surroundings around the vehicle, and the vehicle at a start in them.

        On a course in MuJoCo this takes some tenths of a second, for which the board stands still,
        and so does the first `put_back` on it. On a busy machine a guard in real time may be taken
        for dead meanwhile; a twin that is started with another seed has no such wait.
        """
        self._link.ask(op="course", seed=seed)

    def advance(self, seconds: float) -> int:
        """Let time go by on the twin's clock, and say what time it is then, in nanoseconds.

        Raises:
            RobotError: If the board runs in real time.
        """
        return self._link.ask(op="sleep", ns=round(seconds * 1e9))["t"]

    def break_camera(self, how: CameraFault) -> None:
        """Let the camera fail; "" for a camera that works."""
        self._link.ask(op="camera", how=how)

    def press_bumper(self, down: bool = True) -> None:
        """Press all bumpers, or let them go."""
        self._link.ask(op="press", what="bumper", down=down)

    def press_stop(self, down: bool = True) -> None:
        """Press the emergency stop button, or let it go."""
        self._link.ask(op="press", what="stop", down=down)

    def set_battery(self, volts: float | None) -> None:
        """Let the battery have this voltage without load; None for a full one."""
        self._link.ask(op="battery", volts=volts)

    def set_distance(self, metres: float | None, *, dead: bool = False) -> None:
        """Let distance sensors see this; None for the truth, and `dead` for no echo at all."""
        self._link.ask(op="distance", metres=metres, dead=dead)

    def break_chip(self, bus: int, address: int, *, dead: bool = True) -> None:
        """Let a chip stop answering, or answer again."""
        self._link.ask(op="chip", bus=bus, address=address, dead=dead)

    def break_servo(self, tendon: str, how: ServoFault) -> None:
        """Let something happen to the servo of a tendon; "" takes back what can be taken back."""
        self._link.ask(op="servo_fault", tendon=tendon, how=how)

    def break_magnet(self, joint: str, how: Magnet = "gone") -> None:
        """Let something happen to the magnet of a joint's encoder; "" for one that is well."""
        self._link.ask(op="magnet", joint=joint, how=how)

    def tensions(self) -> dict[str, float]:
        """What each tendon on the servo bus is pulled with now, N, by name."""
        return self._link.ask(op="tensions")["tensions"]

    def levels(self) -> Levels:
        """What all outputs do now."""
        answer = self._link.ask(op="levels")
        return Levels(
            duties=dict(answer["duties"]),
            pulses={pin: Pulse(us, hz) for pin, us, hz in answer["pulses"]},
            channels={PwmChannel(b, a, n): Pulse(us, hz) for b, a, n, us, hz in answer["channels"]},
            edges_ns=dict(answer["edges_ns"]),
        )

    def where(self) -> Whereabouts:
        """Where the vehicle is."""
        answer = self._link.ask(op="where")
        return Whereabouts(**{name: answer[name] for name in Whereabouts._fields})

    def close(self) -> None:
        """Leave."""
        self._link.close()


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
