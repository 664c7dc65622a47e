"""Start a board in its own process, or find one that runs."""

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

from shapechanger.contract.plan import GuardPlan
from shapechanger.errors import RobotError, check_seed
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.twin.board_client import BoardClient
from shapechanger.robot.twin.place import Place
from shapechanger.robot.twin.wiring import ONE_SHOT_MS, TwinWiring

_HARDWARE: Final = "shapechanger.robot.twin.hardware:connect"
"""Source of the twin's hardware for a robot's processes; its argument is the board's socket."""

_READY_S: Final = 30.0
_END_S: Final = 5.0
_MAX_SOCKET_PATH: Final = 100  # Bytes; Linux takes 107.


class BoardSettings(msgspec.Struct, frozen=True):
    """Settings of a board's process.

    Attributes:
        plan: The robot as it is wired, as the JSON of a `GuardPlan`.
        folder: Folder of its files; see `BoardAt`.
        clock: Kind of clock.
        seed: Seed of everything random.
        one_shot_ms: Hold time of the enable line's one-shot, ms; None without one.
        place: Place of the robot.
        camera: Front camera; None without one.
    """

    plan: str
    folder: str
    clock: Literal["real", "twin"]
    seed: int
    one_shot_ms: float | None
    place: Place
    camera: CameraPlan | None


@dataclass(frozen=True, slots=True)
class BoardAt:
    """Files of a board."""

    folder: Path

    @property
    def socket_path(self) -> str:
        """Socket on which it listens; the argument of `_HARDWARE`."""
        return str(self.folder / "board.socket")

    @property
    def ledger_path(self) -> Path:
        """Its ledger."""
        return self.folder / "ledger.jsonl"

    @property
    def fifo_path(self) -> Path:
        """Pipe of its pictures; it exists only with a camera."""
        return self.folder / "camera.mjpeg"

    @property
    def hardware(self) -> tuple[str, str]:
        """Source of a robot's hardware, with its argument."""
        return _HARDWARE, self.socket_path

    def camera_plan(self, plan: CameraPlan) -> CameraPlan:
        """Return the camera of a profile, reading the pictures of this board.

        Raises:
            RobotError: If the board has no camera.
        """
        if not self.fifo_path.is_fifo():
            raise RobotError("This twin was started without a camera.")
        return replace(plan, driver="pipe", settings={"path": str(self.fifo_path)})


@dataclass(frozen=True, slots=True)
class RunningBoard(BoardAt):
    """A board that this process has started. It ends with `close`, or with this process."""

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
    board = BoardAt(Path(folder).absolute())
    if not Path(board.socket_path).is_socket():
        return None
    try:
        client = BoardClient(board.socket_path, "operator")
    except RobotError:
        return None
    client.close()
    return board, client.clock


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
        RobotError: If it does not start, the folder cannot be used, or the seed is not a whole
            number from 0 to 2^32 - 1.
    """
    seed = check_seed(seed, RobotError)
    TwinWiring(wiring, one_shot_ms)  # Raises for a robot that the twin does not know.
    at = BoardAt(Path(folder).absolute())
    if len(os.fsencode(at.socket_path)) > _MAX_SOCKET_PATH:
        raise RobotError(f"The path {at.socket_path} is too long for a socket.")
    if not at.folder.is_dir():
        raise RobotError(f"There is no folder {at.folder} for the twin: make it first.")
    for left in (at.socket_path, at.ledger_path, at.fifo_path):
        if os.path.lexists(left):
            raise RobotError(f"A twin has left {left}: give a folder without it.")
    if camera is not None:
        os.mkfifo(at.fifo_path)
    settings = BoardSettings(
        plan=wiring.to_json(),
        folder=str(at.folder),
        clock=clock,
        seed=seed,
        one_shot_ms=one_shot_ms,
        place=place or Place(),
        camera=camera,
    )
    ours, theirs = socket.socketpair()
    with theirs, tempfile.TemporaryFile() as file:
        file.write(msgspec.json.encode(settings))
        file.seek(0)
        fds = file.fileno(), theirs.fileno()
        process = subprocess.Popen(
            [sys.executable, "-m", "shapechanger.robot.twin.board", *map(str, fds)],
            stdin=subprocess.DEVNULL,
            pass_fds=fds,
            start_new_session=True,  # So that Ctrl-C reaches the robot but not the board.
        )
    board = RunningBoard(at.folder, process, ours)
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
