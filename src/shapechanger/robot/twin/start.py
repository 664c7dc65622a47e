"""Start a board in a separate process, or find a running one."""

from __future__ import annotations

import os
import pkgutil
import select
import socket
import subprocess
import sys
from collections.abc import Collection, Generator, Mapping
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final, Literal

import msgspec

from shapechanger.contract.plan import GuardPlan
from shapechanger.contract.world import World
from shapechanger.errors import RobotError, check_seed
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.twin.ledger import ONE_SHOT_MS, TwinWiring
from shapechanger.robot.twin.room import DrivingWorld
from shapechanger.robot.twin.rpc import BoardClient

_READY_S: Final = 30.0
_END_S: Final = 5.0
_MAX_SOCKET_PATH: Final = 100  # Longest path of a socket, bytes; the limit of Linux is 107.


@dataclass(frozen=True, slots=True)
class Place:
    """A world and the body in it."""

    # Function that opens the world, as "module:function"; "" for the plain room, which needs no
    # simulator. It is called with the arguments of `open_world` except `place`.
    opener: str = ""
    # Further keyword arguments of the opener, JSON values.
    arguments: Mapping[str, Any] = field(default_factory=dict[str, Any])


def open_world(place: Place, parts: Collection[str], camera: CameraPlan | None, seed: int) -> World:
    """Open the world of a place for a robot whose outputs move `parts`.

    The `seed` selects the surroundings and the start.
    """
    if not place.opener:
        plan = camera or CameraPlan("")
        return DrivingWorld(parts, plan.size, seed, plan.pitch_deg, plan.fovy_deg)
    return pkgutil.resolve_name(place.opener)(parts, camera, seed, **place.arguments)


class BoardSettings(msgspec.Struct, frozen=True):
    """Settings of a board's process; see `start_board`."""

    plan: str  # JSON of a `GuardPlan`.
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
        """Socket on which the board listens."""
        return str(self.folder / "board.socket")

    @property
    def ledger_path(self) -> Path:
        """Ledger of the twin."""
        return self.folder / "ledger.jsonl"

    @property
    def fifo_path(self) -> Path:
        """Pipe of the camera's images; it exists only with a camera."""
        return self.folder / "camera.mjpeg"

    @property
    def hardware(self) -> tuple[str, str]:
        """Function that connects a robot's process to the board, MODULE:NAME, and its argument."""
        return "shapechanger.robot.twin.hardware:connect", self.socket_path

    def camera_plan(self, plan: CameraPlan) -> CameraPlan:
        """Return the camera plan of a profile, changed to read the images of this board."""
        if not self.fifo_path.is_fifo():
            raise RobotError("This twin was started without a camera.")
        return replace(plan, driver="pipe", settings={"path": str(self.fifo_path)})


def end(process: subprocess.Popen[bytes], within_s: float) -> None:
    """Wait for the end of a process, and kill it after `within_s` seconds."""
    try:
        process.wait(within_s)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def find_board(folder: str | os.PathLike[str]) -> tuple[BoardAt, Literal["real", "twin"]] | None:
    """Return the board that runs in a folder, and its clock; None if no board runs there."""
    board = BoardAt(Path(folder).absolute())
    with suppress(RobotError), closing(BoardClient(board.socket_path, "operator")) as client:
        return board, client.clock
    return None


@contextmanager
def start_board(
    wiring: GuardPlan,
    clock: Literal["real", "twin"],
    folder: str | os.PathLike[str],
    camera: CameraPlan | None = None,
    seed: int = 0,
    one_shot_ms: float | None = ONE_SHOT_MS,
    place: Place | None = None,
) -> Generator[BoardAt]:
    """Start a board, which ends with the `with` block or with this process.

    Args:
        wiring: Plan with the simulated wiring.
        clock: The machine's clock ("real"), or one that only clients advance ("twin").
        folder: Existing folder for socket, ledger and pipe, without files of another board.
        camera: Front camera; None without a camera.
        seed: Seed of everything random, 0 to 2^32 - 1.
        one_shot_ms: Hold time of the enable line's one-shot, ms; None without a one-shot.
        place: Place of the vehicle; None for the plain room.
    """
    seed = check_seed(seed, RobotError)
    TwinWiring(wiring, one_shot_ms)  # Refuse a robot that cannot be simulated.
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
        wiring.to_json(), str(at.folder), clock, seed, one_shot_ms, place or Place(), camera
    )
    ours, theirs = socket.socketpair()
    ours.set_inheritable(True)  # The board outlives an `exec` of this process.
    command = [sys.executable, "-m", "shapechanger.robot.twin.board", str(theirs.fileno())]
    with theirs:
        process = subprocess.Popen(
            [*command, msgspec.json.encode(settings)],
            pass_fds=[theirs.fileno()],
            start_new_session=True,  # So that Ctrl-C reaches the robot but not the board.
        )
    try:
        with ours:  # The board ends when `ours` is closed.
            ready, _, _ = select.select([ours], [], [], _READY_S)
            if not ready or not ours.recv(1):
                raise RobotError("The twin's board did not start; its output gives the reason.")
            yield at
    finally:
        end(process, _END_S)
