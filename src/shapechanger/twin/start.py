"""Start a board in a process of its own, or find one that runs."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Literal

import msgspec

from shapechanger.errors import RobotError
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.guard.plan import GuardPlan
from shapechanger.twin.board_client import BoardClient
from shapechanger.twin.wiring import ONE_SHOT_MS, TwinWiring
from shapechanger.twin.world.place import Place

_HARDWARE: Final = "shapechanger.twin.hardware:connect"
"""Source of the twin's hardware for a robot's processes; its argument is the board's socket."""

_SOCKET: Final = "board.socket"
_LEDGER: Final = "ledger.jsonl"
_FIFO: Final = "camera.mjpeg"
_READY_S: Final = 30.0
_END_S: Final = 5.0
_MAX_SOCKET_PATH: Final = 100  # Bytes; Linux takes 107.


class BoardSettings(msgspec.Struct, frozen=True):
    """Settings of a board's process.

    Attributes:
        plan: The robot as it is wired, as the JSON of a `GuardPlan`.
        socket: Path of the socket to listen on.
        ledger: Path of the ledger to write.
        clock: Kind of clock.
        seed: Seed of everything random.
        one_shot_ms: Hold time of the enable line's one-shot, ms; None without one.
        place: Place of the robot.
        camera: Front camera; None without one.
        fifo: Path of the pipe for its pictures.
    """

    plan: str
    socket: str
    ledger: str
    clock: Literal["real", "twin"]
    seed: int
    one_shot_ms: float | None
    place: Place
    camera: CameraPlan | None
    fifo: str


@dataclass(frozen=True, slots=True)
class BoardAt:
    """Paths of a board.

    Attributes:
        socket_path: Socket on which it listens; the argument of `_HARDWARE`.
        ledger_path: Its ledger.
        fifo_path: Pipe of its pictures; None without a camera.
    """

    socket_path: str
    ledger_path: Path
    fifo_path: Path | None

    @property
    def hardware(self) -> tuple[str, str]:
        """Source of a robot's hardware, with its argument."""
        return _HARDWARE, self.socket_path

    def camera_plan(self, plan: CameraPlan) -> CameraPlan:
        """Return the camera of a profile, reading the pictures of this board.

        Raises:
            RobotError: If the board has no camera.
        """
        if self.fifo_path is None:
            raise RobotError("This twin was started without a camera.")
        return replace(plan, driver="pipe", settings={"path": str(self.fifo_path)})


@dataclass(frozen=True, slots=True)
class RunningBoard(BoardAt):
    """A board that this process has started. It ends with `close`, or with this process.

    Attributes:
        process: Process of the board.
        owner: Our end of the connection that keeps the board running.
    """

    process: subprocess.Popen[bytes]
    owner: socket.socket

    def __enter__(self) -> RunningBoard:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def outlive_exec(self) -> None:
        """Keep the board running when this process executes another program."""
        self.owner.set_inheritable(True)

    def close(self) -> None:
        """End the board."""
        self.owner.close()
        try:
            self.process.wait(_END_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


def find_board(folder: str | os.PathLike[str]) -> tuple[BoardAt, Literal["real", "twin"]] | None:
    """Return the board that runs in a folder, and its clock; None without one."""
    folder = Path(folder).absolute()
    socket_path = folder / _SOCKET
    if not socket_path.is_socket():
        return None
    try:
        client = BoardClient(str(socket_path), "operator")
    except RobotError:
        return None
    clock = client.clock
    client.close()
    fifo_path = folder / _FIFO
    found = BoardAt(str(socket_path), folder / _LEDGER, fifo_path if fifo_path.is_fifo() else None)
    return found, clock


def start_board(
    wiring: GuardPlan,
    clock: Literal["real", "twin"],
    folder: str | os.PathLike[str],
    camera: CameraPlan | None = None,
    seed: int = 0,
    one_shot_ms: float | None = ONE_SHOT_MS,
    place: Place | None = None,
) -> RunningBoard:
    """Start a board and wait until it listens.

    Args:
        wiring: The robot as it is really wired.
        clock: The machine's clock ("real"), or one that only clients advance ("twin").
        folder: Existing folder for its socket, ledger and pipe, without such files.
        camera: Front camera; None without one.
        seed: Seed of the room, the first start and everything random.
        one_shot_ms: Hold time of the enable line's one-shot, ms; None without one.
        place: Place of the vehicle; None for the plain room.

    Raises:
        RobotError: If it does not start, or the folder cannot be used.
    """
    TwinWiring(wiring, one_shot_ms)  # Raises for a robot that the twin does not know.
    folder = Path(folder).absolute()
    socket_path, ledger_path, fifo_path = (folder / name for name in (_SOCKET, _LEDGER, _FIFO))
    if len(os.fsencode(socket_path)) > _MAX_SOCKET_PATH:
        raise RobotError(f"The path {socket_path} is too long for a socket.")
    if not folder.is_dir():
        raise RobotError(f"There is no folder {folder} for the twin: make it first.")
    for left in (socket_path, ledger_path, fifo_path):
        if os.path.lexists(left):
            raise RobotError(f"A twin has left {left}: give a folder without it.")
    if camera is not None:
        os.mkfifo(fifo_path)
    settings = BoardSettings(
        plan=wiring.to_json(),
        socket=str(socket_path),
        ledger=str(ledger_path),
        clock=clock,
        seed=seed,
        one_shot_ms=one_shot_ms,
        place=place or Place(),
        camera=camera,
        fifo=str(fifo_path),
    )
    ours, theirs = socket.socketpair()
    with theirs, tempfile.TemporaryFile() as file:
        file.write(msgspec.json.encode(settings))
        file.seek(0)
        fds = file.fileno(), theirs.fileno()
        process = subprocess.Popen(
            [sys.executable, "-m", "shapechanger.twin.board", *map(str, fds)],
            stdin=subprocess.DEVNULL,
            pass_fds=fds,
            start_new_session=True,  # So that Ctrl-C reaches the robot but not the board.
        )
    pipe = None if camera is None else fifo_path
    board = RunningBoard(str(socket_path), ledger_path, pipe, process, ours)
    ours.settimeout(_READY_S)
    try:
        ready = ours.recv(1)
    except TimeoutError:
        ready = b""
    if not ready:
        process.kill()
        board.close()
        raise RobotError("The twin's board did not start; its output above gives the reason.")
    ours.settimeout(None)
    return board
