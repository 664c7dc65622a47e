"""Ids of all envs, registered without importing a simulator."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

import gymnasium as gym
import msgspec

from shapechanger.errors import UnknownName

NAMESPACE: Final = "shapechanger"

REMOTE_FINGER: Final = "shapechanger/RemoteFinger-v1"
"""Id of the env of a finger on a rig, with the layouts of `Finger-v1`."""

REMOTE_VEHICLE: Final = "shapechanger/RemoteVehicle-v1"
"""Id of the env of a robot on the network, whose body is unknown until the robot answers."""


VEHICLE_ENVS: Final[Mapping[str, tuple[str, str]]] = MappingProxyType(
    {
        "shapechanger/Car-v1": ("car", "front wheels that steer, in a corridor"),
        "shapechanger/Tank-v1": ("tank", "two tracks, in a corridor"),
        "shapechanger/Truck-v1": ("truck", "front wheels that steer and a trailer, in a yard"),
        "shapechanger/Boat-v1": ("boat", "propeller and rudder, in a harbour"),
    }
)
"""Vehicle and summary by id; all have the same task, and their bodies form no family."""

RANGES_ENVS: Final[Mapping[str, tuple[str, str]]] = MappingProxyType(
    {
        env_id.replace("-v1", "Ranges-v1"): (vehicle, "the same, seeing distances; fast")
        for env_id, (vehicle, _) in VEHICLE_ENVS.items()
    }
)
"""Vehicle and summary by id, for the same task on distances instead of pictures."""

WAYPOINT_ENVS: Final[Mapping[str, tuple[str, str]]] = MappingProxyType(
    {
        env_id.replace("-v1", "Waypoint-v1"): (vehicle, "camera and action the same for all")
        for env_id, (vehicle, _) in VEHICLE_ENVS.items()
    }
)
"""Vehicle and summary by id, for the same task with waypoints as actions."""


class TaskEntry(msgspec.Struct, frozen=True):
    """An env whose body does not belong to a family.

    Attributes:
        entry_point: Module and class.
        summary: One-line description.
        learner: Name of the learner settings tuned on it.
        episode_steps: Steps after which an episode is truncated.
    """

    entry_point: str
    summary: str
    learner: str
    episode_steps: int


FINGER_ENVS: Final[Mapping[str, TaskEntry]] = MappingProxyType(
    {
        "shapechanger/Finger-v1": TaskEntry(
            "shapechanger.envs.finger:FingerReachEnv",
            "finger of seven tendons: reach a point",
            "ppo-finger",
            100,
        ),
        "shapechanger/FingerTrack-v1": TaskEntry(
            "shapechanger.envs.finger:FingerTrackEnv",
            "finger of seven tendons: follow a path",
            "ppo-finger",
            250,
        ),
    }
)
"""Envs of the finger by id."""


class CatalogueEntry(msgspec.Struct, frozen=True):
    """An env whose body belongs to a family.

    Attributes:
        name: Its name; the id is `shapechanger/NAME-v1`.
        family: Name of its body's family.
        summary: One-line description.
        entry_point: Module and class.
        learner: Name of the learner settings tuned on the family.
        body: Name of its body, passed to the class; empty for the default of the class.
        reward_threshold: Return that counts as solved.
    """

    name: str
    family: str
    summary: str
    entry_point: str
    learner: str
    body: str = ""
    reward_threshold: float | None = None

    @property
    def id(self) -> str:
        """The registered id."""
        return f"{NAMESPACE}/{self.name}-v1"


_PENDULUM: Final = "shapechanger.envs.pendulum:InvertedPendulumEnv"
_ANT: Final = "shapechanger.envs.ant:AntEnv"
_EXTENDED_ANT: Final = "shapechanger.envs.ant:ExtendedAntEnv"
# Gymnasium's own thresholds for InvertedPendulum-v5 and Ant-v5.
_UP: Final = 950.0
_RUNS: Final = 6000.0

_RUNNERS: Final = "shapechanger.envs.runners"
_DOUBLE_PENDULUM: Final = "shapechanger.envs.pendulum"

# Gymnasium's other bodies, unedited: name, summary, module, learner, and the reward threshold of
# its v5 id.
_OTHERS: Final = (
    ("HalfCheetah", "half a cheetah that runs in a plane", _RUNNERS, "ppo-run", 4800.0),
    ("Hopper", "one leg that hops in a plane", _RUNNERS, "ppo-planar", 3800.0),
    ("Walker2d", "two legs that walk in a plane", _RUNNERS, "ppo-planar", None),
    ("Swimmer", "three links that swim", _RUNNERS, "ppo-swim", 360.0),
    ("Humanoid", "two legs, two arms and a waist", _RUNNERS, "ppo-run", None),
    ("InvertedDoublePendulum", "two poles on a cart", _DOUBLE_PENDULUM, "ppo-planar", 9100.0),
)

CATALOGUE: Final[dict[str, CatalogueEntry]] = {
    entry.id: entry
    for entry in (
        CatalogueEntry(
            "InvertedPendulum",
            "InvertedPendulum",
            "a pole of 0.6 m on a cart",
            _PENDULUM,
            "ppo-balance",
            "InvertedPendulum",
            _UP,
        ),
        CatalogueEntry(
            "SmallInvertedPendulum",
            "InvertedPendulum",
            "a pole half as long",
            _PENDULUM,
            "ppo-balance",
            "SmallInvertedPendulum",
            _UP,
        ),
        CatalogueEntry(
            "BigInvertedPendulum",
            "InvertedPendulum",
            "a pole twice as long",
            _PENDULUM,
            "ppo-balance",
            "BigInvertedPendulum",
            _UP,
        ),
        CatalogueEntry("Ant", "Ant", "four legs of two joints", _ANT, "ppo-run", "Ant", _RUNS),
        CatalogueEntry(
            "AmputatedAnt",
            "Ant",
            "one back shank cut to a quarter",
            _ANT,
            "ppo-run",
            "AmputatedAnt",
            _RUNS,
        ),
        CatalogueEntry(
            "BigAnt", "Ant", "all shanks twice as long", _ANT, "ppo-run", "BigAnt", _RUNS
        ),
        CatalogueEntry(
            "ExtendedAnt",
            "Ant",
            "a third segment with a motor on each leg",
            _EXTENDED_ANT,
            "ppo-run",
            "",
            _RUNS,
        ),
        *(
            CatalogueEntry(
                name,
                name,
                summary,
                f"{module}:{name}Env",
                learner,
                name,
                threshold,
            )
            for name, summary, module, learner, threshold in _OTHERS
        ),
    )
}

_EPISODE_STEPS: Final = 1000
_RANGES_STEPS: Final = 400  # A learner meets more courses.
# Families with a fast step of their own, which Gymnasium's wrappers would slow down.
_TUNED: Final = ("Ant", "InvertedPendulum")


def register_all() -> None:
    """Register every env of the catalogue with Gymnasium, once."""
    for entry in CATALOGUE.values():
        if entry.id not in gym.registry:
            gym.register(  # pyright: ignore[reportUnknownMemberType]  # Gymnasium's `**kwargs`.
                entry.id,
                entry.entry_point,
                reward_threshold=entry.reward_threshold,
                max_episode_steps=_EPISODE_STEPS,
                vector_entry_point=f"shapechanger.envs.vector.entry_points:{entry.name}",
                # Their own step requires a reset, and the tests check the envs.
                order_enforce=entry.family not in _TUNED,
                disable_env_checker=entry.family in _TUNED,
                kwargs={"body": entry.body} if entry.body else {},
            )
    for envs, kind, limit in (
        (VEHICLE_ENVS, "VehicleEnv", _EPISODE_STEPS),
        (RANGES_ENVS, "RangesEnv", _RANGES_STEPS),
        (WAYPOINT_ENVS, "WaypointEnv", _EPISODE_STEPS),
    ):
        for env_id, (vehicle, _) in envs.items():
            if env_id not in gym.registry:
                gym.register(  # pyright: ignore[reportUnknownMemberType]  # Gymnasium's `**kwargs`.
                    env_id,
                    f"shapechanger.envs.vehicle:{kind}",
                    max_episode_steps=limit,
                    kwargs={"vehicle": vehicle},
                )
    for env_id, task in FINGER_ENVS.items():
        if env_id not in gym.registry:
            gym.register(  # pyright: ignore[reportUnknownMemberType]  # Gymnasium's `**kwargs`.
                env_id, task.entry_point, max_episode_steps=task.episode_steps
            )
    if REMOTE_FINGER not in gym.registry:
        gym.register(  # pyright: ignore[reportUnknownMemberType]  # Gymnasium's `**kwargs`.
            REMOTE_FINGER,
            "shapechanger.envs.remote.finger:RemoteFingerEnv",
            max_episode_steps=FINGER_ENVS["shapechanger/Finger-v1"].episode_steps,
            nondeterministic=True,  # A robot.
        )
    if REMOTE_VEHICLE not in gym.registry:
        gym.register(  # pyright: ignore[reportUnknownMemberType]  # Gymnasium's `**kwargs`.
            REMOTE_VEHICLE,
            "shapechanger.envs.remote.vehicle:RemoteVehicleEnv",
            nondeterministic=True,  # A robot.
        )


def find(env_id: str) -> CatalogueEntry:
    """Return the entry of an id, or of a name such as `BigAnt`.

    Raises:
        UnknownName: If there is none.
    """
    name = _name(env_id)
    entry = CATALOGUE.get(f"{NAMESPACE}/{name}-v1")
    if entry is None:
        known = [entry.name for entry in CATALOGUE.values()]
        others = map(
            _name, (*VEHICLE_ENVS, *RANGES_ENVS, *WAYPOINT_ENVS, *FINGER_ENVS, REMOTE_FINGER)
        )
        raise UnknownName("environment", name, [*known, *others])
    return entry


def find_task(env_id: str) -> str | None:
    """Return the id of an env without a family, such as `Car` or `Finger`; None for others."""
    full = f"{NAMESPACE}/{_name(env_id)}-v1"
    known = (*VEHICLE_ENVS, *RANGES_ENVS, *WAYPOINT_ENVS, *FINGER_ENVS, REMOTE_FINGER)
    return full if full in known else None


def _name(env_id: str) -> str:
    return env_id.removeprefix(f"{NAMESPACE}:").removeprefix(f"{NAMESPACE}/").removesuffix("-v1")
