"""Ids of all envs, registered without importing a simulator, and names that users give.

Users name an env by its id, a short name such as `BigAnt`, `module:id`, or the file of a robot.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import gymnasium as gym
import msgspec

from shapechanger.contract.env_ref import EnvRef
from shapechanger.envs.odrl import odrl_bodies
from shapechanger.envs.opengl import require_known_gl
from shapechanger.errors import MorphologyError, StudyError, UnknownName

NAMESPACE: Final = "shapechanger"
MODEL_FILES: Final = (".xml", ".mjcf", ".urdf")
"""Suffixes of files of users' robots."""
_IN_MODULE: Final = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^:]+")  # Such as `module:id`.


class CatalogueEntry(msgspec.Struct, frozen=True):
    """An env.

    Attributes:
        name: Its name; the id is `shapechanger/NAME-v1`.
        summary: One-line description; empty for the envs of robots on the network.
        entry_point: Module and class, below `shapechanger`.
        learner: Name of the env's default learner settings.
        family: Name of its body's family; empty for an env whose body belongs to none.
        reward_threshold: Return that counts as solved.
        episode_steps: Steps after which an episode is truncated; None for never.
        device: Module that registers its batched functions for a device; empty if it has none.
        kwargs: Arguments of the class.
    """

    name: str
    summary: str
    entry_point: str
    learner: str = "ppo-run"
    family: str = ""
    reward_threshold: float | None = None
    episode_steps: int | None = 1000
    device: str = ""
    kwargs: Mapping[str, Any] = {}

    @property
    def id(self) -> str:
        """The registered id."""
        return f"{NAMESPACE}/{self.name}-v1"


def _by_id(*entries: CatalogueEntry) -> dict[str, CatalogueEntry]:
    return {entry.id: entry for entry in entries}


# For each family the module and class of its env, its default learner settings, and the reward
# threshold of Gymnasium's v5 id.
_FAMILIES: Final = {
    "InvertedPendulum": ("pendulum:InvertedPendulumEnv", "ppo-pendulum", 950.0),
    "Ant": ("ant:AntEnv", "ppo-run", 6000.0),
    "HalfCheetah": ("runners:HalfCheetahEnv", "ppo-run", 4800.0),
    "Hopper": ("runners:HopperEnv", "ppo-planar", 3800.0),
    "Walker2d": ("runners:Walker2dEnv", "ppo-planar", None),
    "Swimmer": ("runners:SwimmerEnv", "ppo-swim", 360.0),
    "Humanoid": ("runners:HumanoidEnv", "ppo-humanoid", None),
    "InvertedDoublePendulum": ("pendulum:InvertedDoublePendulumEnv", "ppo-planar", 9100.0),
}
# Families with their own fast step, which Gymnasium's wrappers would slow down.
_TUNED: Final = ("Ant", "InvertedPendulum")


def _body(name: str, family: str, summary: str) -> CatalogueEntry:
    entry_point, learner, threshold = _FAMILIES[family]
    if name == "ExtendedAnt":  # Its spaces are larger, so its class has a page of its own.
        entry_point = "ant:ExtendedAntEnv"
    return CatalogueEntry(
        name,
        summary,
        f"envs.{entry_point}",
        learner,
        family,
        threshold,
        device=f"shapechanger.envs.{entry_point.partition(':')[0]}_gpu",
        kwargs={"body": name},
    )


CATALOGUE: Final = _by_id(
    _body("InvertedPendulum", "InvertedPendulum", "a pole of 0.6 m on a cart"),
    _body("SmallInvertedPendulum", "InvertedPendulum", "a pole half as long"),
    _body("BigInvertedPendulum", "InvertedPendulum", "a pole twice as long"),
    _body("Ant", "Ant", "four legs of two joints"),
    _body("AmputatedAnt", "Ant", "one back shank cut to a quarter"),
    _body("BigAnt", "Ant", "all shanks twice as long"),
    _body("ExtendedAnt", "Ant", "a third segment with a motor on each leg"),
    _body("HalfCheetah", "HalfCheetah", "half a cheetah that runs in a plane"),
    _body("Hopper", "Hopper", "one leg that hops in a plane"),
    _body("Walker2d", "Walker2d", "two legs that walk in a plane"),
    _body("Swimmer", "Swimmer", "three links that swim"),
    _body("Humanoid", "Humanoid", "two legs, two arms and a waist"),
    _body("InvertedDoublePendulum", "InvertedDoublePendulum", "two poles on a cart"),
)
"""Envs whose bodies belong to a family, keyed by id."""

_ROBOTS: Final = {family.lower(): family for family in _FAMILIES}
ODRL_ENVS: Final = _by_id(
    *(
        _body(name, _ROBOTS[name.split("-")[1]], f"body of ODRL: {name.removeprefix('odrl-')}")
        for name in odrl_bodies()  # Such as `odrl-ant-friction-0.1`.
    )
)
"""Envs of ODRL, keyed by id: 4 sources and 80 targets; see `shapechanger.envs.odrl`."""


_VEHICLES: Final = (
    ("Car", "front wheels that steer, in a corridor"),
    ("Tank", "two tracks, in a corridor"),
    ("Truck", "front wheels that steer and a trailer, in a yard"),
    ("Boat", "propeller and rudder, in a harbour"),
)


def _drive(
    suffix: str, entry_point: str, *, steps: int, learner: str, summary: str = ""
) -> dict[str, CatalogueEntry]:
    """Return an env of each vehicle with the same task, keyed by id."""
    entries: list[CatalogueEntry] = []
    for name, world in _VEHICLES:
        vehicle = name.lower()
        entries.append(
            CatalogueEntry(
                f"{name}{suffix}",
                f"{vehicle}: {summary or world}",
                f"vehicles.envs.{entry_point}",
                learner,
                episode_steps=steps,
                kwargs={"vehicle": vehicle},
            )
        )
    return _by_id(*entries)


VEHICLE_ENVS: Final = _drive("", "vehicle:VehicleEnv", steps=1000, learner="cloning")
"""Envs of vehicles with a camera, keyed by id; their bodies form no family."""
RANGES_ENVS: Final = _drive(
    "Ranges",
    "ranges:RangesEnv",
    steps=400,  # Short, so that learners see more courses.
    learner="ppo-drive",
    summary="the same task with distances instead of images; fast",
)
"""Envs of vehicles with distances instead of images, keyed by id."""
WAYPOINT_ENVS: Final = _drive(
    "Waypoint",
    "vehicle:WaypointEnv",
    steps=1000,
    learner="waypoint",
    summary="camera and action are the same for all vehicles",
)
"""Envs of vehicles with waypoints as actions, keyed by id."""


def _finger(name: str, entry_point: str, task: str, steps: int) -> CatalogueEntry:
    return CatalogueEntry(
        name,
        f"finger of seven tendons: {task}",
        f"finger.{entry_point}",
        "ppo-finger",
        episode_steps=steps,
        device="shapechanger.finger.gpu",
    )


FINGER_ENVS: Final = _by_id(
    _finger("Finger", "reach:FingerReachEnv", "reach a point", 100),
    _finger("FingerTrack", "track:FingerTrackEnv", "follow a path", 250),
)
"""Envs of the finger, keyed by id."""

_OWN: Final = CatalogueEntry(
    "OwnRobot",
    "your MJCF or URDF file; give FILE or FILE@TASK as ENV",
    "envs.own:OwnRobotEnv",
)
OWN_ROBOT: Final = _OWN.id
"""Id of the env for a user's robot, from a file, with an optional task of the user."""

# Envs of robots on the network: two for a finger on a rig, with the layouts of `Finger-v1` and
# `FingerTrack-v1`; one for a robot whose body is unknown until it answers; and one for a vehicle
# with the camera and the action that all vehicles share.
_REMOTE: Final = _by_id(
    *(
        CatalogueEntry(f"Remote{name}", "", entry_point, learner, episode_steps=steps)
        for name, entry_point, learner, steps in (
            ("Finger", "finger.remote:RemoteFingerEnv", "ppo-rig", 100),
            ("FingerTrack", "finger.remote:RemoteFingerTrackEnv", "ppo-rig", 250),
            ("Vehicle", "robot.client.env:RemoteVehicleEnv", "ppo-run", None),
            ("Waypoint", "vehicles.remote.waypoints:RemoteWaypointEnv", "ppo-run", None),
        )
    )
)
ON_DEVICE: Final = (*CATALOGUE.values(), *FINGER_ENVS.values())
"""Envs with batched functions for a device, except ODRL's, whose classes are among these."""
_DRIVES: Final = {**VEHICLE_ENVS, **RANGES_ENVS, **WAYPOINT_ENVS}
# All envs but ODRL's.
_NAMED: Final = {**CATALOGUE, OWN_ROBOT: _OWN, **_DRIVES, **FINGER_ENVS, **_REMOTE}
# All envs, in the order of their registration.
_ALL: Final = {**CATALOGUE, **ODRL_ENVS, **_NAMED}


def summaries() -> dict[str, str]:
    """Return a line on each env except ODRL's and those of robots on the network, keyed by id."""
    return {env_id: entry.summary for env_id, entry in _NAMED.items() if entry.summary}


def register_all() -> None:
    """Register every env with Gymnasium unless its id is registered already."""
    for env_id, entry in _ALL.items():
        if env_id in gym.registry:
            continue
        vectors = f"shapechanger.envs.make_vec:{entry.name}"
        gym.register(  # pyright: ignore[reportUnknownMemberType]  # Gymnasium's `**kwargs`.
            env_id,
            f"shapechanger.{entry.entry_point}",
            reward_threshold=entry.reward_threshold,
            nondeterministic=env_id in _REMOTE,
            max_episode_steps=entry.episode_steps,
            # These envs check that `reset` was called, and the tests check the envs.
            order_enforce=entry.family not in _TUNED,
            disable_env_checker=entry.family in _TUNED,
            vector_entry_point=vectors if entry.family or entry is _OWN else None,
            kwargs=dict(entry.kwargs),
        )


def find(env_id: str) -> CatalogueEntry:
    """Return the entry of an id, or of a name such as `BigAnt` or `odrl/ant-friction-0.5`.

    Raises:
        UnknownName: If no such env exists.
    """
    name = env_id.removeprefix(f"{NAMESPACE}:").removeprefix(f"{NAMESPACE}/").removesuffix("-v1")
    if name.startswith("odrl/"):  # Ids of Gymnasium have one slash only.
        name = name.replace("/", "-", 1)
    entry = _ALL.get(f"{NAMESPACE}/{name}-v1")
    if entry is None:
        known = ODRL_ENVS if name.startswith("odrl") else _NAMED
        raise UnknownName("environment", name, [each.name for each in known.values()])
    return entry


def env_ref(env_id: str, body: str = "") -> EnvRef:
    """Return a reference to an env that a user names, optionally with another body."""
    require_known_gl()
    file, at, own_task = env_id.partition("@")
    if file.endswith(MODEL_FILES):
        allow_own_modules(own_task)
        more = {"task": own_task} if at else {}
        return EnvRef(OWN_ROBOT, {"path": file, **more, **({"body": body} if body else {})})
    try:
        full = find(env_id).id
    except UnknownName:
        # Accept third-party envs, as `module:id` or if registered; `make` checks them again.
        if not _IN_MODULE.fullmatch(env_id) and env_id not in gym.registry:
            raise
        allow_own_modules(env_id)
        full = env_id
    if body and full not in {*CATALOGUE, *ODRL_ENVS, OWN_ROBOT}:
        raise MorphologyError(f"{full} takes no body; these do: {', '.join(CATALOGUE)}.")
    return EnvRef(full, {"body": body} if body else {})


def short_name(env_id: str) -> str:
    """Return the name of an env as a part of a folder's name."""
    file, _, own_task = env_id.partition("@")
    if file.endswith(MODEL_FILES):
        return "-".join(filter(None, (Path(file).stem, own_task.rpartition(":")[2])))
    return env_id.replace("odrl/", "odrl-").rpartition("/")[2].removesuffix("-v1")


def allow_own_modules(*names: str | None) -> None:
    """Let names such as `my_methods:warm-start`, and TOML files, import from the current folder.

    Call it only with names that the user gives: a class name in a policy's file must not import
    modules of the folder.
    """
    here = str(Path.cwd())
    own = any(name and (":" in name or name.endswith(".toml")) for name in names)
    if own and here not in sys.path:
        sys.path.append(here)  # Worker processes inherit the path.


def default_learner(env: EnvRef) -> str:
    """Return the name of an env's default learner settings; the ant's for other packages' envs."""
    return _ALL[env.id].learner if env.id in _ALL else "ppo-run"


def driven(env: EnvRef, lenses: Sequence[str] = ()) -> EnvRef:
    """Return an env for a study: a vehicle gets lenses, and is put back after collisions."""
    if lenses and env.id not in VEHICLE_ENVS:
        raise StudyError(f"{env} has no camera; these have one: {', '.join(VEHICLE_ENVS)}.")
    if env.id not in _DRIVES:
        return env
    more: dict[str, Any] = {"lenses": list(lenses)} if lenses else {}
    return EnvRef(env.id, {**env.kwargs, "put_back": True, **more})
