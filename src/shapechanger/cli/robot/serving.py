"""From a profile and the options of a command to the plan that a robot's processes are given."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Final, Literal

import msgspec

from shapechanger.errors import MissingExtra, ProfileError, RobotError, UnknownName
from shapechanger.robot.daemon.credentials import (
    Credentials,
    credentials_folder,
    load_credentials,
    make_credentials,
)
from shapechanger.robot.daemon.plan import DaemonPlan
from shapechanger.robot.guard.plan import GuardPlan
from shapechanger.robot.guard.serve_plan import ServePlan
from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.robot.profile.profile import Profile
from shapechanger.twin.place import Place
from shapechanger.twin.start import BoardAt, RunningBoard, start_board
from shapechanger.worlds.course import HOME, require_element

__all__ = [
    "ServeOptions",
    "TwinOptions",
    "credentials_of",
    "finger_of",
    "place_of",
    "recordings_folder",
    "serve_plan",
    "start_twin",
]

_EVERYWHERE: Final = "0.0.0.0"
_HERE: Final = "127.0.0.1"
_ROOM: Final = "room"
# While the twin draws a picture its time stands still, and a guard that waits for it is not dead.
_TWIN_PATIENCE_MS: Final = 10_000


@dataclass(frozen=True)
class TwinOptions:
    """How a twin stands in for the hardware.

    Attributes:
        folder: Folder for its socket, its ledger and its pictures' pipe; it must exist.
        clock: Whether time passes by itself, or only when somebody asks for it.
        wired_as: Profile of what is really attached; "" for the one that is served.
        seed: Seed of the world.
        one_shot: Whether the one-shot of the enable line is fitted, where the profile has one.
        place: Where its vehicle is; None for the plain room.
    """

    folder: Path
    clock: Literal["real", "twin"] = "real"
    wired_as: str = ""
    seed: int = 0
    one_shot: bool = True
    place: Place | None = None


@dataclass(frozen=True)
class ServeOptions:
    """How a robot is served.

    Attributes:
        host: Address to listen at; "" for every one, or only this machine's own on a twin or
            without TLS.
        port: Port to listen at; 0 for any that is free.
        insecure: Whether to speak without TLS.
        credentials: Folder of the key and the certificate; None for the robot's own.
        arm_by_program: Whether programs may arm it; on a twin they always may.
        announce: Whether to let others find it on the network.
        ready_file: File to write the address into; None for none.
        recordings: Folder for what is recorded; None for the robot's own.
    """

    host: str = ""
    port: int = 5000
    insecure: bool = False
    credentials: Path | None = None
    arm_by_program: bool = False
    announce: bool = True
    ready_file: Path | None = None
    recordings: Path | None = None


def recordings_folder(name: str) -> Path:
    """Where a robot keeps what it records, if nobody says where; by its name.

    Raises:
        RobotError: If the name is no name of a folder.
    """
    data = os.environ.get("XDG_DATA_HOME", "")
    # As for the credentials: a relative path must be ignored.
    base = Path(data) if data.startswith("/") else Path.home() / ".local" / "share"
    return base / "shapechanger" / "recordings" / credentials_folder(name).name


def credentials_of(name: str, folder: Path | None, *, make: bool) -> Credentials:
    """The credentials of a robot; made first if they may be.

    Raises:
        RobotError: If there are none, or others may read them.
        OutputError: If they cannot be written.
    """
    folder = folder or credentials_folder(name)
    return make_credentials(folder, name) if make else load_credentials(folder)


def finger_of(profile: Profile, gap: str, seed: int | None) -> Place | None:
    """The finger on a rig, where its tendons are those of a finger and MuJoCo is there.

    Args:
        profile: The robot.
        gap: Name of the gap that the finger is drawn from; "" for the nominal finger.
        seed: Which finger of the gap it is.

    Returns:
        None for any other robot.

    Raises:
        RobotError: If a gap is asked for and there is no finger.
        UnknownName: If there is no such gap.
        MissingExtra: If a gap is asked for and MuJoCo is not installed.
    """
    tendons = {output.name for output in profile.outputs if output.driver == "dynamixel"}
    if find_spec("mujoco") is None:
        if gap:
            raise MissingExtra("mujoco", "sim")
        return None
    from shapechanger.bodies.finger import NOMINAL, TENDONS

    if tendons != set(TENDONS):
        if gap:
            raise RobotError(
                f"A --gap is between fingers, and {profile.name} has no servos for the tendons "
                f"{', '.join(TENDONS)}."
            )
        return None
    if not gap:
        return Place(finger=NOMINAL.to_json())
    import numpy as np

    from shapechanger.envs.finger.gap import resolve_gap

    return Place(finger=resolve_gap(gap).draw(np.random.default_rng(seed or 0)).to_json())


def place_of(profile: Profile, world: str, lenses: Sequence[str]) -> Place:
    """Where the vehicle of a twin is.

    Args:
        profile: The robot.
        world: Kind of place; "room" for the plain room, "" for where such a vehicle is at home, or
            the room where there is no such vehicle, or no MuJoCo.
        lenses: What is wrong with the camera.

    Raises:
        UnknownName: If there is no such place or lens.
        ProfileError: If there is no vehicle in MuJoCo with the parts of the profile.
        WorldError: If that vehicle cannot drive there.
        MissingExtra: If MuJoCo is needed and not installed.
    """
    if world == _ROOM or (not world and find_spec("mujoco") is None):
        if lenses:
            raise RobotError("The plain room has a plain camera: choose a --world for a --lens.")
        return Place()
    try:
        from shapechanger.bodies.vehicles import VEHICLES, require_fit
        from shapechanger.worlds.layout import WORLDS
        from shapechanger.worlds.lens import lens as find_lens
    except ModuleNotFoundError as error:
        raise MissingExtra(error.name or "mujoco", "sim") from error

    for lens in lenses:
        find_lens(lens)
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
        return Place(HOME[profile.body], profile.body, tuple(lenses))
    if profile.body not in VEHICLES:
        raise ProfileError(
            f"{profile.path}: there is no {profile.body} in MuJoCo, only {', '.join(VEHICLES)}; "
            "--world room takes any robot."
        )
    require_fit(profile.body, parts)
    require_element(profile.body, floats=VEHICLES[profile.body].floats, world=world)
    return Place(world, profile.body, tuple(lenses))


def start_twin(profile: Profile, options: TwinOptions) -> RunningBoard:
    """Start the twin of a robot's pins, in a process of its own.

    Raises:
        ProfileError: If what is really attached is no profile.
        RobotError: If the twin does not start.
    """
    wiring: GuardPlan = profile.guard_plan()
    if options.wired_as:
        wiring = load_profile(find_profile(options.wired_as)).guard_plan()
    return start_board(
        wiring,
        clock=options.clock,
        folder=options.folder,
        camera=profile.camera,
        seed=options.seed,
        one_shot_ms=float(wiring.enable_hold_ms) if options.one_shot else None,
        place=options.place,
    )


def serve_plan(
    profile: Profile,
    options: ServeOptions,
    board: BoardAt | None = None,
    clock: Literal["real", "twin"] = "real",
) -> ServePlan:
    """What the processes of a robot need.

    Args:
        profile: The robot.
        options: How it is served.
        board: The twin of its pins; None for the pins of this machine.
        clock: Where its time comes from.

    Raises:
        RobotError: If it has no credentials, or others may read them, or it would be open to
            everybody.
    """
    credentials = credentials_of(profile.name, options.credentials, make=board is not None)
    here = board is not None or options.insecure
    daemon = DaemonPlan(
        robot=profile.name,
        body=profile.body,
        action_layout=profile.action_layout().to_json(),
        state_layout=profile.state_layout().to_json(),
        camera=profile.camera,
        control_hz=profile.control_hz,
        deadline_ms=profile.limits.deadline_ms,
        max_observation_age_ms=profile.max_observation_age_ms,
        reward=profile.reward_weights(),
        reset=profile.reset_routine(),
        arming="anyone" if options.arm_by_program or board else profile.arming,
        host=options.host or (_HERE if here else _EVERYWHERE),
        port=options.port,
        certificate="" if options.insecure else str(credentials.certificate),
        private_key="" if options.insecure else str(credentials.private_key),
        key_file=str(credentials.key_file),
        insecure=options.insecure,
        discovery=options.announce,
        ready_file=str(options.ready_file.absolute()) if options.ready_file else "",
        recordings=str((options.recordings or recordings_folder(profile.name)).absolute()),
    )
    guard = profile.guard_plan()
    if board is None:
        return ServePlan(guard, daemon.to_dict())
    camera = board.camera_plan(profile.camera) if profile.camera else None
    daemon = msgspec.structs.replace(daemon, camera=camera, clock=clock)
    patience_ms = _TWIN_PATIENCE_MS if clock == "twin" else 0
    return ServePlan(guard, daemon.to_dict(), board.hardware, patience_ms=patience_ms)
