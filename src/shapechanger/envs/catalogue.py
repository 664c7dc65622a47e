"""Ids of all envs, registered without importing a simulator."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import gymnasium as gym
import msgspec

from shapechanger.envs.odrl import odrl_bodies
from shapechanger.errors import UnknownName

NAMESPACE: Final = "shapechanger"

# Envs of robots on the network: two for a finger on a rig, with the layouts of `Finger-v1` and
# `FingerTrack-v1`; one for a robot whose body is unknown until it answers; and one for a vehicle
# with the camera and the action that all vehicles share.
REMOTE_FINGER: Final = "shapechanger/RemoteFinger-v1"
REMOTE_FINGER_TRACK: Final = "shapechanger/RemoteFingerTrack-v1"
REMOTE_VEHICLE: Final = "shapechanger/RemoteVehicle-v1"
REMOTE_WAYPOINT: Final = "shapechanger/RemoteWaypoint-v1"
OWN_ROBOT: Final = "shapechanger/OwnRobot-v1"
"""Id of the env for a user's robot, from a file, with an optional task of the user."""

MODEL_FILES: Final = (".xml", ".mjcf", ".urdf")
"""Suffixes of files of users' robots."""

VEHICLE_ENVS: Final[Mapping[str, tuple[str, str]]] = {
    "shapechanger/Car-v1": ("car", "front wheels that steer, in a corridor"),
    "shapechanger/Tank-v1": ("tank", "two tracks, in a corridor"),
    "shapechanger/Truck-v1": ("truck", "front wheels that steer and a trailer, in a yard"),
    "shapechanger/Boat-v1": ("boat", "propeller and rudder, in a harbour"),
}
"""Vehicle and summary, keyed by id; all have the same task, and their bodies form no family."""


def _variants(suffix: str, summary: str) -> Mapping[str, tuple[str, str]]:
    return {
        env_id.replace("-v1", f"{suffix}-v1"): (vehicle, summary)
        for env_id, (vehicle, _) in VEHICLE_ENVS.items()
    }


RANGES_ENVS: Final = _variants("Ranges", "the same task with distances instead of images; fast")
"""Vehicle and summary, keyed by id, for the same task with distances instead of images."""

WAYPOINT_ENVS: Final = _variants("Waypoint", "camera and action are the same for all vehicles")
"""Vehicle and summary, keyed by id, for the same task with waypoints as actions."""


class CatalogueEntry(msgspec.Struct, frozen=True):
    """An env.

    Attributes:
        name: Its name; the id is `shapechanger/NAME-v1`.
        family: Name of its body's family; empty for an env whose body belongs to none.
        summary: One-line description.
        entry_point: Module and class.
        learner: Name of the learner settings tuned on the family or the env.
        reward_threshold: Return that counts as solved.
        episode_steps: Steps after which an episode is truncated.
        device: Module that registers its batched functions for a device; empty if it has none.
    """

    name: str
    family: str
    summary: str
    entry_point: str
    learner: str
    reward_threshold: float | None = None
    episode_steps: int = 1000
    device: str = ""

    @property
    def id(self) -> str:
        """The registered id."""
        return f"{NAMESPACE}/{self.name}-v1"


def _finger(name: str, entry_point: str, task: str, steps: int) -> CatalogueEntry:
    return CatalogueEntry(
        *(name, "", f"finger of seven tendons: {task}", f"shapechanger.finger.{entry_point}"),
        learner="ppo-finger",
        episode_steps=steps,
        device="shapechanger.finger.gpu",
    )


_REACH: Final = _finger("Finger", "reach:FingerReachEnv", "reach a point", 100)
_TRACK: Final = _finger("FingerTrack", "track:FingerTrackEnv", "follow a path", 250)
FINGER_ENVS: Final = {entry.id: entry for entry in (_REACH, _TRACK)}
"""Envs of the finger, keyed by id."""

# For each family the module and class of its env, the learner settings tuned on it, and the reward
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
# Name, family and summary of each body.
_BODIES: Final = (
    ("InvertedPendulum", "InvertedPendulum", "a pole of 0.6 m on a cart"),
    ("SmallInvertedPendulum", "InvertedPendulum", "a pole half as long"),
    ("BigInvertedPendulum", "InvertedPendulum", "a pole twice as long"),
    ("Ant", "Ant", "four legs of two joints"),
    ("AmputatedAnt", "Ant", "one back shank cut to a quarter"),
    ("BigAnt", "Ant", "all shanks twice as long"),
    ("ExtendedAnt", "Ant", "a third segment with a motor on each leg"),
    ("HalfCheetah", "HalfCheetah", "half a cheetah that runs in a plane"),
    ("Hopper", "Hopper", "one leg that hops in a plane"),
    ("Walker2d", "Walker2d", "two legs that walk in a plane"),
    ("Swimmer", "Swimmer", "three links that swim"),
    ("Humanoid", "Humanoid", "two legs, two arms and a waist"),
    ("InvertedDoublePendulum", "InvertedDoublePendulum", "two poles on a cart"),
)


def _entry(name: str, family: str, summary: str) -> CatalogueEntry:
    entry_point, learner, threshold = _FAMILIES[family]
    if name == "ExtendedAnt":  # Its spaces are larger, so its class has a page of its own.
        entry_point = "ant:ExtendedAntEnv"
    place = f"shapechanger.envs.{entry_point}"
    return CatalogueEntry(name, family, summary, place, learner, threshold)


CATALOGUE: Final = {entry.id: entry for entry in (_entry(*row) for row in _BODIES)}

_ROBOTS: Final = {family.lower(): family for family in _FAMILIES}
ODRL_ENVS: Final = {
    entry.id: entry
    for name in odrl_bodies()  # Such as `odrl-ant-friction-0.1`.
    for task in [name.removeprefix("odrl-")]
    for entry in [_entry(name, _ROBOTS[task.partition("-")[0]], f"body of ODRL: {task}")]
}
"""Envs of ODRL, keyed by id: 4 sources and 80 targets; see `shapechanger.envs.odrl`."""

# Envs whose bodies form no family, except the vehicle on the network.
_TASK_IDS: Final = (
    *(*VEHICLE_ENVS, *RANGES_ENVS, *WAYPOINT_ENVS, *FINGER_ENVS),
    *(REMOTE_FINGER, REMOTE_FINGER_TRACK, OWN_ROBOT),
)
# Families with their own fast step, which Gymnasium's wrappers would slow down.
_TUNED: Final = ("Ant", "InvertedPendulum")


def summaries() -> dict[str, str]:
    """Return a line on each env, keyed by id."""
    vehicles = {**VEHICLE_ENVS, **RANGES_ENVS, **WAYPOINT_ENVS}
    return {
        **{entry.id: entry.summary for entry in CATALOGUE.values()},
        **{env_id: f"{vehicle}: {summary}" for env_id, (vehicle, summary) in vehicles.items()},
        **{env_id: task.summary for env_id, task in FINGER_ENVS.items()},
    }


def register_all() -> None:
    """Register every env of the catalogue with Gymnasium, once."""
    for entry in (*CATALOGUE.values(), *ODRL_ENVS.values()):
        _register(
            entry.id,
            entry.entry_point,
            reward_threshold=entry.reward_threshold,
            vector_entry_point=f"shapechanger.envs.make_vec:{entry.name}",
            # These envs check that `reset` was called, and the tests check the envs.
            order_enforce=entry.family not in _TUNED,
            disable_env_checker=entry.family in _TUNED,
            kwargs={"body": entry.name},
        )
    vectors = "shapechanger.envs.make_vec:OwnRobot"
    _register(OWN_ROBOT, "shapechanger.envs.own:OwnRobotEnv", vector_entry_point=vectors)
    for envs, kind, steps in (
        (VEHICLE_ENVS, "vehicle:VehicleEnv", 1000),
        (RANGES_ENVS, "ranges:RangesEnv", 400),  # Short, so that learners see more courses.
        (WAYPOINT_ENVS, "vehicle:WaypointEnv", 1000),
    ):
        for env_id, (vehicle, _) in envs.items():
            entry_point = f"shapechanger.vehicles.envs.{kind}"
            _register(env_id, entry_point, steps, kwargs={"vehicle": vehicle})
    for env_id, entry in FINGER_ENVS.items():
        _register(env_id, entry.entry_point, entry.episode_steps)
    for env_id, entry_point, steps in (
        (REMOTE_FINGER, "finger.remote:RemoteFingerEnv", _REACH.episode_steps),
        (REMOTE_FINGER_TRACK, "finger.remote:RemoteFingerTrackEnv", _TRACK.episode_steps),
        (REMOTE_VEHICLE, "robot.client.env:RemoteVehicleEnv", None),
        (REMOTE_WAYPOINT, "vehicles.remote.waypoints:RemoteWaypointEnv", None),
    ):
        _register(env_id, f"shapechanger.{entry_point}", steps, nondeterministic=True)


def _register(env_id: str, entry_point: str, steps: int | None = 1000, **more: Any) -> None:
    """Register an env unless it is registered already."""
    if env_id not in gym.registry:
        gym.register(env_id, entry_point, max_episode_steps=steps, **more)  # pyright: ignore[reportUnknownMemberType]  # Gymnasium's `**kwargs`.


def find(env_id: str) -> CatalogueEntry:
    """Return the entry of an id, or of a name such as `BigAnt` or `odrl/ant-friction-0.5`.

    Raises:
        UnknownName: If no such env exists.
    """
    name = _name(env_id)
    full = f"{NAMESPACE}/{name}-v1"
    entry = CATALOGUE.get(full) or ODRL_ENVS.get(full)
    if entry is None:
        if name.startswith("odrl"):
            raise UnknownName("environment", name, [each.name for each in ODRL_ENVS.values()])
        known = [entry.name for entry in CATALOGUE.values()]
        raise UnknownName("environment", name, [*known, *map(_name, _TASK_IDS)])
    return entry


def find_task(env_id: str) -> str | None:
    """Return the id of an env without a family, such as `Car` or `Finger`; None for others."""
    full = f"{NAMESPACE}/{_name(env_id)}-v1"
    return full if full in _TASK_IDS else None


def _name(env_id: str) -> str:
    name = env_id.removeprefix(f"{NAMESPACE}:").removeprefix(f"{NAMESPACE}/").removesuffix("-v1")
    # Ids of Gymnasium have one slash only.
    return f"odrl-{name.removeprefix('odrl/')}" if name.startswith("odrl/") else name
