"""Serve a robot: plan its processes, start its twin, and store it as a known robot."""

from __future__ import annotations

import contextlib
import shutil
import socket
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

import msgspec

from shapechanger.errors import LinkError, RobotError, UnknownName, translate_errors
from shapechanger.robot.client.known_robots import KnownRobot, recall, remember
from shapechanger.robot.daemon.credentials import (
    Credentials,
    credentials_folder,
    load_credentials,
    make_credentials,
    user_folder,
)
from shapechanger.robot.daemon.plan import DaemonPlan
from shapechanger.robot.guard.running import ServePlan
from shapechanger.robot.link.address import (
    address_here,
    cannot_listen,
    is_loopback,
    parse_address,
)
from shapechanger.robot.link.card import card_of
from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.twin.start import BoardAt, Place, find_board, start_board

_HERE: Final = "127.0.0.1"
_EVERYWHERE: Final = "0.0.0.0"
_PILOT: Final = "shapechanger.vehicles.remote.pilot"
# With `--clock twin`, guard and daemon are killed only after this silence, ms. The clock is paused
# while the twin renders, and a guard that waits for it is silent without having failed.
_TWIN_PATIENCE_MS: Final = 10_000


@dataclass(frozen=True, kw_only=True)
class Service:
    """Options of serving a robot, on its hardware or on a twin."""

    twin: bool = False
    """Run on simulated pins and in a simulated world instead of this machine's pins. The robot is
    then stored as a known robot, unless another one has its name, --insecure is given, or both
    --credentials and --port 0 are."""
    host: str = ""
    """Address to listen at; all of this machine's if not given, only 127.0.0.1 with --twin or
    --insecure."""
    port: int = 5000
    """Port to listen at; 0 for any free port."""
    clock: Literal["real", "twin"] = "real"
    """With --twin: whether time passes by itself, or only when a program takes a step."""
    wired_as: str = ""
    """With --twin: the profile of the simulated wiring, if it differs from the served profile."""
    seed: int = 0
    """With --twin: seed of the world."""
    twin_folder: Path | None = None
    """With --twin: folder for the ledger of all pins and the twin's socket; a new one if not
    given. If a twin already runs there, it is used."""
    insecure: bool = False
    """Serve without TLS. The key is still needed."""
    credentials: Path | None = None
    """Folder of key and certificate, which a twin makes if needed; `init`'s folder if not given."""
    arm_by_program: bool = False
    """Let programs arm the robot. By default only persons may; on a twin anyone may."""
    announce: bool = True
    """Announce the robot, so that `shapechanger robot find` lists it."""
    ready_file: Path | None = None
    """File to write the port and the fingerprint into, as JSON, once the robot can be reached."""

    recordings: Path | None = None
    """Folder for the robot's recordings; ~/.local/share/shapechanger/recordings/NAME if not
    given."""
    policy: Path | None = None
    """A policy on board, written by `shapechanger policies export`, which drives once a person arms
    the robot for it; or a folder of policies, one of which is chosen in the console."""

    def board(
        self, profile: Profile, place: Callable[[], Place], undo: contextlib.ExitStack
    ) -> BoardAt:
        """Return the twin's board: a running one in the folder, or a new one, in a new process."""
        folder = self.twin_folder
        if folder is None:
            folder = Path(tempfile.mkdtemp(prefix="shapechanger-twin-"))
            undo.callback(shutil.rmtree, folder, ignore_errors=True)
        if found := find_board(folder):
            board, clock = found
            if clock != self.clock:
                raise RobotError(f"The twin in {folder} runs on --clock {clock}.")
            return board
        wired = load_profile(find_profile(self.wired_as)) if self.wired_as else profile
        wiring = wired.guard_plan()
        started = start_board(
            wiring,
            clock=self.clock,
            folder=folder,
            camera=profile.camera,
            seed=self.seed,
            one_shot_ms=float(wiring.enable_hold_ms),
            place=place(),
        )
        return undo.enter_context(started)

    def plan(self, profile: Profile, board: BoardAt | None) -> ServePlan:
        """Return the plan for the robot's processes; `board` is the twin's, None on hardware."""
        name, guard, camera = profile.name, profile.guard_plan(), profile.camera
        folder = self.credentials or credentials_folder(name)
        policy = self.policy
        if board is None:
            load_credentials(folder)
        else:
            make_credentials(folder, name)
            camera = camera and board.camera_plan(camera)
        is_open = self.arm_by_program or board is not None
        is_local = self.insecure or board is not None
        policies = policy if policy is None or policy.is_dir() else policy.parent
        daemon = DaemonPlan(
            card=card_of(
                profile,
                arming="anyone" if is_open else "",
                clock="real" if board is None else self.clock,
            ),
            camera=camera,
            host=self.host or (_HERE if is_local else _EVERYWHERE),
            port=self.port,
            credentials=_absolute(folder),
            insecure=self.insecure,
            discovery=self.announce,
            ready_file=_absolute(self.ready_file),
            recordings=_absolute(self.recordings or recordings_folder(name)),
            policies=_absolute(policies),
            policy="" if policy is None or policy == policies else policy.stem,
            pilot=_PILOT if policies else "",
        )
        fields = msgspec.to_builtins(daemon)
        if board is None:
            return ServePlan(guard, fields)
        patience_ms = _TWIN_PATIENCE_MS if self.clock == "twin" else 0
        return ServePlan(guard, fields, board.hardware, patience_ms=patience_ms)

    def make_known(self, name: str, plan: ServePlan, port: int) -> str:
        """Store a twin as a known robot, see `store`, and return a message about it.

        Do nothing and return "" if the twin has no TLS, if `credentials` is given and the system
        chose the port, or if the name cannot be a file name.
        """
        if self.insecure or (self.credentials is not None and not self.port):
            return ""
        credentials = load_credentials(self.credentials or credentials_folder(name))
        plan.daemon["port"] = port  # A restarted daemon keeps the port.
        with contextlib.suppress(LinkError):  # Some names of robots cannot be file names.
            return store(robot_at(str(address_here(self.host, port)), name, credentials))
        return ""


def _absolute(path: Path | None) -> str:
    return "" if path is None else str(path.absolute())


def require_free(host: str, port: int) -> int:
    """Check that an address is free before starting anything, and return its port."""
    with translate_errors(OSError, to=lambda error: cannot_listen(host, port, error)):
        family, *_, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        with socket.create_server(address, family=family) as listener:
            return listener.getsockname()[1]


def recordings_folder(name: str) -> Path:
    """Return the default folder for a robot's recordings."""
    return (
        user_folder("XDG_DATA_HOME", ".local/share") / "recordings" / credentials_folder(name).name
    )


def store(robot: KnownRobot) -> str:
    """Store a local robot, unless its name is taken or it is known at an address of a network.

    Returns:
        Summary message.
    """
    name = robot.name
    try:
        known = recall(name)
    except UnknownName:
        known = robot
    except LinkError as error:
        return f"It is not stored as a known robot: {error}"
    if (known.key, known.fingerprint) != (robot.key, robot.fingerprint):
        return (
            f"Another robot is known here as {name}, at {known.address}, and stays known: "
            f"`shapechanger robot find --forget {name}` makes room for this one."
        )
    before, now = parse_address(known.address), parse_address(robot.address)
    if before != now and not is_loopback(before.host):
        return f"Known here as {name} at {before}, which stays; this one is at {now}."
    remember(robot)
    moved = "" if before == now else f", now at {now} instead of {before}"
    return f"Known here as {name}{moved}: `shapechanger robot drive {name}` drives it from here."


def robot_at(address: str, name: str, credentials: Credentials) -> KnownRobot:
    """Return the address and credentials that clients use for a robot."""
    return KnownRobot(name, address, credentials.key, credentials.fingerprint.hex())
