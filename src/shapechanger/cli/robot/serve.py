"""`shapechanger robot serve`: run a robot on its hardware or on a twin."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import socket
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Final, Literal

import tyro

from shapechanger.cli.console import say
from shapechanger.cli.robot.key import robot_at
from shapechanger.cli.robot.setup import require_pins, require_port
from shapechanger.demos.cloning.pictures import PolicyError
from shapechanger.errors import (
    LinkError,
    MissingExtra,
    ProfileError,
    RobotError,
    RobotRefused,
    UnknownName,
    check_seed,
    no_policy_file,
)
from shapechanger.robot.client.known_robots import (
    KnownRobot,
    check_name,
    known_names,
    recall,
    remember,
)
from shapechanger.robot.daemon.credentials import (
    credentials_folder,
    load_credentials,
    make_credentials,
)
from shapechanger.robot.daemon.plan import DaemonPlan, card_of
from shapechanger.robot.daemon.policies import ENDING, policies_in
from shapechanger.robot.guard.serve_plan import ServePlan, plan_fd, supervisor_command
from shapechanger.robot.link.address import Address, is_loopback, parse_address
from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.twin.start import BoardAt, find_board, start_board
from shapechanger.robot.twin.world.place import Place
from shapechanger.vehicles.courses.course import HOME, require_element

_HERE: Final = "127.0.0.1"
_LOOK_EVERY_S: Final = 0.1
_EVERYWHERE: Final = "0.0.0.0"
_ROOM: Final = "room"
_PILOT: Final = "shapechanger.vehicles.remote.pilot"
# A twin's clock is paused while it renders, and a guard that waits for it is alive.
_TWIN_PATIENCE_MS: Final = 10_000


@dataclass(frozen=True)
class Serve:
    """Run a robot's guard and daemon, on its hardware or on a twin."""

    profile: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="PROFILE")]
    """A profile, such as car.toml, or the name of one that comes with Shapechanger."""
    twin: bool = False
    """Run on simulated pins and in a simulated world in place of this machine's pins. It is then
    known here by its name, unless another robot is."""
    host: str = ""
    """Address to listen at; all of this machine's if not given, only 127.0.0.1 with --twin or
    --insecure."""
    port: int = 5000
    """Port to listen at; 0 for any that is free."""
    clock: Literal["real", "twin"] = "real"
    """With --twin: whether time passes by itself, or only when a program takes a step."""
    wired_as: str = ""
    """With --twin: the profile of what is really attached to the pins, if not the one served."""
    seed: int = 0
    """With --twin: seed of the world."""
    world: str = ""
    """With --twin: corridor, yard, harbour or flooded-corridor, or room for a plain room that needs
    no MuJoCo; the vehicle's default if not given."""
    lens: tuple[str, ...] = ()
    """With --twin: disturbances of the camera, such as night or dirt."""
    gap: str = ""
    """With --twin, for a finger: name of the gap that it is drawn from, such as real-like; the
    nominal finger if not given."""
    finger_seed: int | None = None
    """With --gap: seed of the finger drawn from it, as finger_seed of Finger-v1."""
    twin_folder: Path | None = None
    """With --twin: folder for the ledger of all pins and the twin's socket; a new one if not
    given. A twin that runs there already is used as it is."""
    insecure: bool = False
    """Serve without TLS. The key is still needed."""
    credentials: Path | None = None
    """Folder of the robot's key and certificate, if not the one that `init` made."""
    arm_by_program: bool = False
    """Let programs arm the robot. By default a person has to; on a twin anyone may."""
    announce: bool = True
    """Let `shapechanger robot find` find it."""
    ready_file: Path | None = None
    """File to write the port and the fingerprint into, as JSON, once the robot can be reached."""

    recordings: Path | None = None
    """Folder for the robot's recordings; ~/.local/share/shapechanger/recordings/NAME if not
    given."""
    policy: Path | None = None
    """A policy on board, as `shapechanger policies export` writes it, which drives once a person
    arms the robot for it; or a folder of them, among which the console chooses."""

    def run(self) -> None:
        """Become the robot's supervisor; return only on an error."""
        self._refuse_contradictions()
        profile = load_profile(find_profile(self.profile))
        # Undone only after an error: exec keeps everything.
        with contextlib.ExitStack() as undo:
            board = self._board(profile, undo) if self.twin else None
            plan = self._plan(profile, board)
            self._require_policy(DaemonPlan.from_dict(plan.daemon))
            if board is None:
                require_pins(profile.guard_plan())
            port = _require_free(str(plan.daemon["host"]), self.port)
            with contextlib.suppress(OSError):  # A full disk loses messages, not the robot.
                if board is not None:
                    say(f"twin of {profile.name}: ledger {board.ledger_path}")
                    self._make_known(profile.name, plan, port)
                sys.stdout.flush()
            # Replaces this process, which has loaded much that a supervisor does not need.
            os.execv(plan.python, supervisor_command(plan, plan_fd(plan)))

    def _make_known(self, name: str, plan: ServePlan, port: int) -> None:
        """Let another process store the twin's address for this machine once it can be reached.

        This process becomes the supervisor. A robot that does not start must not take the name from
        one that runs.
        """
        # Without TLS, or with credentials of its own and any free port, the caller passes the
        # address on.
        if self.insecure or (self.credentials is not None and not self.port):
            return
        try:
            check_name(name)
        except LinkError:  # Not every name of a robot is that of a file.
            return
        plan.daemon["port"] = port  # A daemon that is started again keeps it.
        credentials = load_credentials(self.credentials or credentials_folder(name))
        host = _HERE if self.host in {"", "0.0.0.0", "::"} else self.host
        robot = robot_at(str(Address(host, port)), name, credentials)
        sys.stdout.flush()
        served_by = os.getpid()
        if child := os.fork():
            os.waitpid(child, 0)
            return
        try:
            # A child of init: the supervisor has no child that it does not know.
            if not os.fork() and _is_reached(Path(plan.daemon["ready_file"]), port, served_by):
                say(make_known(robot))
        finally:
            sys.stdout.flush()
            os._exit(0)

    def _refuse_contradictions(self) -> None:
        """Refuse options that only apply to a twin."""
        asked = {
            "--clock twin": self.clock == "twin",
            "--wired-as": bool(self.wired_as),
            "--twin-folder": self.twin_folder is not None,
            "--seed": self.seed != 0,
            "--world": bool(self.world),
            "--lens": bool(self.lens),
            "--gap": bool(self.gap),
        }
        for option, given in asked.items():
            if given and not self.twin:
                raise RobotError(f"{option} needs --twin.")
        for seed in (self.seed, self.finger_seed or 0):
            check_seed(seed, RobotError)
        if self.finger_seed is not None and not self.gap:
            raise RobotError("--finger-seed selects a finger of a --gap: give --gap, too.")
        if self.gap and self.world:
            raise RobotError("A finger of a --gap has no --world: give only one of them.")
        require_port(self.port)

    def _board(self, profile: Profile, undo: contextlib.ExitStack) -> BoardAt:
        """Return the twin's board: a running one in the folder, or a new one, in a new process."""
        folder = self.twin_folder
        if folder is None:
            folder = Path(tempfile.mkdtemp(prefix="shapechanger-twin-"))
            undo.callback(shutil.rmtree, folder, ignore_errors=True)
        found = find_board(folder)
        if found is None:
            place = finger_of(profile, self.gap, self.finger_seed) if self.gap else None
            wired = load_profile(find_profile(self.wired_as)) if self.wired_as else profile
            wiring = wired.guard_plan()
            started = start_board(
                wiring,
                clock=self.clock,
                folder=folder,
                camera=profile.camera,
                seed=self.seed,
                one_shot_ms=float(wiring.enable_hold_ms),
                place=place or place_of(profile, self.world, self.lens),
            )
            undo.enter_context(started)
            started.outlive_exec()
            return started
        board, clock = found
        if clock != self.clock:
            raise RobotError(f"The twin in {folder} runs on --clock {clock}.")
        return board

    def _plan(self, profile: Profile, board: BoardAt | None) -> ServePlan:
        """Return the plan for the robot's processes; without a board, on this machine's pins."""
        folder = self.credentials or credentials_folder(profile.name)
        is_twin = board is not None
        policies, policy = self._policies()
        ready_file = self.ready_file
        if ready_file is None and board is not None:
            ready_file = board.folder / f"ready-{os.getpid()}.json"
        credentials = (
            make_credentials(folder, profile.name) if is_twin else load_credentials(folder)
        )
        camera = profile.camera
        if board is not None and camera is not None:
            camera = board.camera_plan(camera)
        daemon = DaemonPlan(
            card=card_of(
                profile,
                arming="anyone" if self.arm_by_program or is_twin else "",
                clock=self.clock if is_twin else "real",
            ),
            camera=camera,
            host=self.host or (_HERE if is_twin or self.insecure else _EVERYWHERE),
            port=self.port,
            certificate="" if self.insecure else str(credentials.certificate),
            private_key="" if self.insecure else str(credentials.private_key),
            key_file=str(credentials.key_file),
            insecure=self.insecure,
            discovery=self.announce,
            ready_file=str(ready_file.absolute()) if ready_file else "",
            recordings=str((self.recordings or recordings_folder(profile.name)).absolute()),
            policies=policies,
            policy=policy,
            pilot=_PILOT if policies else "",
        )
        guard = profile.guard_plan()
        if board is None:
            return ServePlan(guard, daemon.to_dict())
        patience_ms = _TWIN_PATIENCE_MS if self.clock == "twin" else 0
        return ServePlan(guard, daemon.to_dict(), board.hardware, patience_ms=patience_ms)

    def _policies(self) -> tuple[str, str]:
        """Return the folder of the policies on board, and the one that starts with the robot."""
        if self.policy is None:
            return "", ""
        path = self.policy.absolute()
        return (str(path), "") if path.is_dir() else (str(path.parent), path.stem)

    def _require_policy(self, plan: DaemonPlan) -> None:
        """Refuse a policy that does not fit the robot, before anything moves."""
        if self.policy is None:
            return
        from shapechanger.demos.cloning.onnx_policy import OnnxClone
        from shapechanger.vehicles.remote.pilot import Origin, require_fit

        files = [self.policy]
        if self.policy.is_dir():
            files = [self.policy / f"{name}{ENDING}" for name in policies_in(self.policy)]
            if not files:
                raise PolicyError(
                    f"There is no policy NAME{ENDING} in {self.policy}: "
                    "`shapechanger policies export` writes one."
                )
        elif not self.policy.exists():
            raise PolicyError(no_policy_file(self.policy, what="file or folder"))
        elif self.policy.suffix != ENDING:
            raise PolicyError(
                f"A policy on board is a file NAME{ENDING}, got {self.policy.name}: "
                "`shapechanger policies export` writes one."
            )
        for file in files:
            policy = OnnxClone(file)
            origin = Origin(policy.body, policy.control_hz)
            try:
                require_fit(policy.card, origin, plan.card, measures=False)
            except (PolicyError, RobotRefused) as error:
                raise PolicyError(f"{file} cannot drive {plan.card.robot}: {error}") from error


def _is_reached(ready_file: Path, port: int, served_by: int) -> bool:
    """Wait until a robot can be reached at a port, or until its supervisor has ended.

    Args:
        ready_file: File that its daemon writes; another robot's may be there.
        port: The port.
        served_by: Process id of the supervisor.
    """
    os.closerange(3, os.sysconf("SC_OPEN_MAX"))  # The twin ends when the last file is closed.
    while True:
        with contextlib.suppress(OSError, ValueError, LookupError, TypeError):
            if json.loads(ready_file.read_text())["port"] == port:
                return True
        try:
            os.kill(served_by, 0)
        except ProcessLookupError:
            return False
        time.sleep(_LOOK_EVERY_S)


def _require_free(host: str, port: int) -> int:
    """Check that an address is free before starting anything, and return its port."""
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        with socket.socket(family, kind, protocol) as listener:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.bind(address)
            listener.listen(1)
            return listener.getsockname()[1]
    except OSError as error:
        raise RobotError(
            f"Cannot listen at {host} port {port}: {error.strerror or error}. "
            "Does the robot run already?"
        ) from error


def recordings_folder(name: str) -> Path:
    """Return the default folder for a robot's recordings.

    Raises:
        RobotError: If the name is not a valid folder name.
    """
    data = os.environ.get("XDG_DATA_HOME", "")
    # As for credentials: a relative path is ignored.
    base = Path(data) if data.startswith("/") else Path.home() / ".local" / "share"
    return base / "shapechanger" / "recordings" / credentials_folder(name).name


def finger_of(profile: Profile, gap: str, seed: int | None) -> Place | None:
    """Return the simulated finger for a rig with a finger's tendons.

    Args:
        profile: The robot.
        gap: Name of the reality gap to draw from; "" for the nominal finger.
        seed: Seed of the draw.

    Returns:
        The place, or None for other robots.

    Raises:
        RobotError: If a gap is given and there is no finger.
        UnknownName: If the gap is unknown.
        MissingExtra: If a gap is given and MuJoCo is not installed.
    """
    tendons = {output.name for output in profile.outputs if output.driver == "bus_servo"}
    if find_spec("mujoco") is None:
        if gap:
            raise MissingExtra("mujoco", "sim")
        return None
    from shapechanger.finger.anatomy import TENDONS
    from shapechanger.finger.parameters import NOMINAL
    from shapechanger.finger.twin import finger_place

    if tendons != set(TENDONS):
        if gap:
            raise RobotError(
                f"A --gap is between fingers, and {profile.name} has no servos for the tendons "
                f"{', '.join(TENDONS)}."
            )
        return None
    if not gap:
        return finger_place(NOMINAL)
    import numpy as np

    from shapechanger.finger.gap import resolve_gap

    return finger_place(resolve_gap(gap).draw(np.random.default_rng(seed or 0)))


def place_of(profile: Profile, world: str, lenses: Sequence[str]) -> Place:
    """Return the world of a twin's vehicle.

    Args:
        profile: The robot.
        world: Kind of course; "room" for the plain room, "" for the vehicle's default, or the room
            without such a vehicle or without MuJoCo.
        lenses: Disturbances of the camera.

    Raises:
        UnknownName: If the course or a lens is unknown.
        ProfileError: If no simulated vehicle has the parts of the profile.
        WorldError: If the vehicle cannot drive there.
        MissingExtra: If MuJoCo is needed and not installed.
    """
    if world == _ROOM or (not world and find_spec("mujoco") is None):
        if lenses:
            raise RobotError("The plain room has a plain camera: choose a --world for a --lens.")
        return Place()
    try:
        from shapechanger.vehicles.bodies import VEHICLES, require_fit
        from shapechanger.vehicles.cameras.corruptions import find_corruption
        from shapechanger.vehicles.courses import WORLDS
        from shapechanger.vehicles.twin import course_place
    except ModuleNotFoundError as error:
        raise MissingExtra(error.name or "mujoco", "sim") from error

    for lens in lenses:
        find_corruption(lens)
    if not world and not lenses and (finger := finger_of(profile, "", None)) is not None:
        return finger
    if world and world not in WORLDS:
        raise UnknownName("world", world, (_ROOM, *WORLDS))
    parts = {output.part for output in profile.outputs if output.part}
    if not world:
        try:
            require_fit(profile.body, parts)
        except (ProfileError, UnknownName):
            return Place()
        return course_place(HOME[profile.body], profile.body, lenses)
    if profile.body not in VEHICLES:
        raise ProfileError(
            f"{profile.path}: there is no {profile.body} in MuJoCo, only {', '.join(VEHICLES)}; "
            "--world room takes any robot."
        )
    require_fit(profile.body, parts)
    require_element(profile.body, floats=VEHICLES[profile.body].floats, world=world)
    return course_place(world, profile.body, lenses)


def make_known(robot: KnownRobot) -> str:
    """Store a local robot among the known robots, unless its name is taken.

    Args:
        robot: The robot, as reached from this machine.

    Returns:
        A sentence on what was done.

    Raises:
        OutputError: If it cannot be stored.
    """
    name = robot.name
    drives = f"`shapechanger robot drive {name}` drives it from here"
    if name not in known_names():
        remember(robot)
        return f"Known here as {name}: {drives}."
    try:
        known = recall(name)
    except (LinkError, UnknownName) as error:
        return f"It is not stored as a known robot: {error}"
    if (known.key, known.fingerprint) != (robot.key, robot.fingerprint):
        return (
            f"Another robot is known here as {name}, at {known.address}, and stays known: "
            f"`shapechanger robot forget {name}` makes room for this one."
        )
    before, now = parse_address(known.address), parse_address(robot.address)
    if before == now:
        return f"Known here as {name}: {drives}."
    if not is_loopback(before.host):
        return f"Known here as {name} at {before}, which stays; this one is at {now}."
    remember(robot)
    return f"Known here as {name}, now at {now} and no more at {before}: {drives}."
