"""Starts a board for the command line and for tests."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Final, Literal

from shapechanger.errors import RobotError
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.guard.plan import GuardPlan
from shapechanger.twin.board_client import Link
from shapechanger.twin.wiring import ONE_SHOT_MS, TwinWiring
from shapechanger.twin.world.place import Place

__all__ = ["HARDWARE", "BoardAt", "RunningBoard", "find_board", "start_board"]

HARDWARE: Final = "shapechanger.twin.hardware:connect"
"""Where a robot's processes get the twin's hardware; its argument is the board's socket."""

_SOCKET: Final = "board.socket"
_LEDGER: Final = "ledger.jsonl"
_FIFO: Final = "camera.mjpeg"
_READY_S: Final = 30.0
_END_S: Final = 5.0
_LONGEST_SOCKET: Final = 100  # Bytes; Linux takes 107.


class BoardAt:
    """Where a board can be reached.

    Attributes:
        socket_path: Where it listens; the argument of `HARDWARE`.
        ledger_path: Its ledger.
        fifo_path: Where its pictures come out; None without a camera.
    """

    def __init__(self, socket_path: str, ledger_path: Path, fifo_path: Path | None) -> None:
        self.socket_path = socket_path
        self.ledger_path = ledger_path
        self.fifo_path = fifo_path

    @property
    def hardware(self) -> tuple[str, str]:
        """Where a robot's processes get their hardware, with its argument."""
        return HARDWARE, self.socket_path

    def camera_plan(self, plan: CameraPlan) -> CameraPlan:
        """The camera of a profile, but reading the pictures of this board."""
        if self.fifo_path is None:
            raise RobotError("This twin was started without a camera.")
        return replace(plan, driver="pipe", settings={"path": str(self.fifo_path)})


class RunningBoard(BoardAt):
    """A board that was started here. It ends with `close`, or when this process does.

    Attributes:
        process: The process.
    """

    def __init__(
        self,
        process: subprocess.Popen[bytes],
        owner: socket.socket,
        socket_path: str,
        ledger_path: Path,
        fifo_path: Path | None,
    ) -> None:
        super().__init__(socket_path, ledger_path, fifo_path)
        self.process = process
        self._owner = owner

    def __enter__(self) -> RunningBoard:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def outlive_exec(self) -> None:
        """Let the board run on when this process becomes another program by exec."""
        self._owner.set_inheritable(True)

    def close(self) -> None:
        """End the board."""
        self._owner.close()
        try:
            self.process.wait(_END_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


def find_board(folder: str | os.PathLike[str]) -> tuple[BoardAt, Literal["real", "twin"]] | None:
    """The board that runs in a folder, and its clock; None if none does."""
    folder = Path(folder).absolute()
    socket_path = folder / _SOCKET
    if not socket_path.is_socket():
        return None
    try:
        link = Link(str(socket_path), "operator")
    except RobotError:
        return None
    clock = link.clock
    link.close()
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
        wiring: What is really attached to its pins.
        clock: Whether time is the machine's, or moves only when it is asked to.
        folder: Where its socket, its ledger and its pipe go; new, or without those.
        camera: What the front camera is like; None for no camera.
        seed: Of the room, the first start and everything random.
        one_shot_ms: How long the one-shot of the enable line holds; None where none is fitted.
        place: Where the vehicle is; None for the plain room.

    Raises:
        RobotError: If it does not start, or the folder is not as it must be.
    """
    TwinWiring(wiring, one_shot_ms)  # Says in words what it does not know.
    folder = Path(folder).absolute()
    socket_path, ledger_path = folder / _SOCKET, folder / _LEDGER
    if len(os.fsencode(socket_path)) > _LONGEST_SOCKET:
        raise RobotError(f"The path {socket_path} is too long for a socket.")
    if not folder.is_dir():
        raise RobotError(f"There is no folder {folder} for the twin: make it first.")
    for left in (socket_path, ledger_path, folder / _FIFO):
        if os.path.lexists(left):
            raise RobotError(f"A twin has left {left}: give a folder without it.")
    ours, theirs = socket.socketpair()
    with theirs, tempfile.TemporaryFile() as file:
        file.write(wiring.to_json().encode())
        file.seek(0)
        command = [sys.executable, "-m", "shapechanger.twin.board"]
        command += ["--plan-fd", str(file.fileno()), "--owner-fd", str(theirs.fileno())]
        command += ["--socket", str(socket_path), "--ledger", str(ledger_path)]
        command += ["--clock", clock, "--seed", str(seed)]
        if one_shot_ms is not None:
            command += ["--one-shot-ms", str(one_shot_ms)]
        if place is not None and place.world:
            command += ["--world", place.world, "--vehicle", place.vehicle]
            command += [part for lens in place.lenses for part in ("--lens", lens)]
        if place is not None and place.finger:
            command += ["--finger", place.finger]
        fifo_path = None
        if camera is not None:
            fifo_path = folder / _FIFO
            os.mkfifo(fifo_path)
            command += ["--fifo", str(fifo_path), "--fps", str(camera.fps)]
            command += ["--size", "{}x{}".format(*camera.size)]
            command += ["--quality", str(camera.jpeg_quality)]
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            pass_fds=(file.fileno(), theirs.fileno()),
            start_new_session=True,  # So that Ctrl-C reaches the robot, and not the board.
        )
    board = RunningBoard(process, ours, str(socket_path), ledger_path, fifo_path)
    ours.settimeout(_READY_S)
    try:
        ready = ours.recv(1)
    except TimeoutError:
        ready = b""
    if not ready:
        process.kill()
        board.close()
        raise RobotError("The twin's board did not start; what it wrote says why.")
    ours.settimeout(None)
    return board
