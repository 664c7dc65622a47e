"""Certificate of the shift between two vehicles: their properties, and how they drive.

Properties prove nothing by themselves, so both vehicles drive the same commands: this also finds a
lens that distorts nothing, or a size that nothing uses.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import gymnasium as gym
import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import EmptyShift, MorphologyError
from shapechanger.vehicles.waypoints import SteeringResponse
from shapechanger.vehicles.world import MujocoWorld

_STEPS: Final = 40
# Commands of the rollout: half of the steps straight ahead, the other half to the left.
_THROTTLE: Final = 0.5
_STEERING: Final = -0.5


class VehicleShift(msgspec.Struct, frozen=True):
    """Differences between a source and a target vehicle.

    Attributes:
        source: Id of the source.
        target: Id of the target.
        changes: Differences of the vehicles, places and cameras, one sentence each.
        answers: Differences of the rollouts with the same commands, one sentence each.
        is_empty: Whether the rollouts gave the same frames, places and rewards.
    """

    source: str
    target: str
    changes: tuple[str, ...]
    answers: tuple[str, ...]
    is_empty: bool

    def __str__(self) -> str:
        """Return the certificate as text."""
        lines = [f"{self.source} -> {self.target}"]
        for title, sentences in (("Changes", self.changes), ("Rollout", self.answers)):
            if sentences:
                lines += [f"{title}:", *(f"  {sentence}" for sentence in sentences)]
        return "\n".join(lines)


def certify_vehicles(
    source: gym.Env[Any, Any],
    target: gym.Env[Any, Any],
    *,
    seed: int = 0,
    allow_empty: bool = False,
) -> VehicleShift:
    """Compare two vehicles, wrappers included, and certify the shift between them.

    Both are reset and stepped, and left in the middle of an episode.

    Args:
        source: The env in which a policy is trained.
        target: The env that it is transferred to.
        seed: Seed of the resets.
        allow_empty: Whether to certify a shift that changes nothing.

    Raises:
        MorphologyError: If one of them is not a vehicle.
        EmptyShift: If they do not differ and `allow_empty` is false.
    """
    names = _name(source), _name(target)
    old, new = _facts(source), _facts(target)
    one, two = _drive(source, seed), _drive(target, seed)
    shift = VehicleShift(
        *names,
        changes=tuple(
            f"{what}: {old[what]} -> {new[what]}" for what in old if old[what] != new[what]
        ),
        answers=_answers(one, two, _commands(source)),
        is_empty=one.same_as(two),
    )
    if shift.is_empty and not allow_empty:
        raise EmptyShift(
            f"{names[0]} and {names[1]} behave alike: {_STEPS} steps gave the same frames, places "
            "and rewards, so there is nothing to transfer."
        )
    return shift


class _Driven(NamedTuple):
    """Rollout of one vehicle.

    Attributes:
        seen: The first and the last observation.
        path: Pose at the start and after each step, (n, 3): x, y, m, and heading, rad.
        rewards: Reward of each step.
        straight_m: Distance driven in the first half.
        turned_deg: Turn to the left in the second half.
    """

    seen: tuple[NDArray[np.float64], NDArray[np.float64]]
    path: NDArray[np.float64]
    rewards: NDArray[np.float64]
    straight_m: float
    turned_deg: float

    def same_as(self, other: _Driven) -> bool:
        """Return whether two rollouts are equal."""
        mine, theirs = (
            (*self.seen, self.path, self.rewards),
            (*other.seen, other.path, other.rewards),
        )
        return all(np.array_equal(one, two) for one, two in zip(mine, theirs, strict=True))


def _drive(env: gym.Env[Any, Any], seed: int) -> _Driven:
    seen, info = env.reset(seed=seed)
    first = _flat(env, seen)
    path, rewards = [info["pose"]], list[float]()
    for step in range(_STEPS):
        steering = 0.0 if step < _STEPS // 2 else _STEERING
        seen, reward, terminated, truncated, info = env.step(
            np.array([steering, _THROTTLE], np.float32)
        )
        path.append(info["pose"])
        rewards.append(float(reward))
        if terminated or truncated:
            break
    way = np.array(path)
    half = min(_STEPS // 2, len(way) - 1)
    turned = np.unwrap(way[half:, 2])
    return _Driven(
        (first, _flat(env, seen)),
        way,
        np.array(rewards),
        float(np.linalg.norm(way[half, :2] - way[0, :2])),
        math.degrees(float(turned[-1] - turned[0])),
    )


def _commands(env: gym.Env[Any, Any]) -> tuple[str, str]:
    """Return what the two numbers of an action are called: sideways and forward."""
    return ("bearing", "speed") if hasattr(env.unwrapped, "response") else ("steering", "throttle")


def _answers(one: _Driven, two: _Driven, commands: tuple[str, str]) -> tuple[str, ...]:
    aside, forward = commands
    sentences = [
        f"straight ahead at a {forward} of {_THROTTLE:g} for {_STEPS // 2} steps: "
        f"{one.straight_m:.2f} m -> {two.straight_m:.2f} m",
        f"then a {aside} of {_STEERING:g} for as many: turned by {one.turned_deg:.0f} -> "
        f"{two.turned_deg:.0f} degrees",
    ]
    if one.seen[0].shape == two.seen[0].shape:
        gaps = [float(np.abs(a - b).mean()) for a, b in zip(one.seen, two.seen, strict=True)]
        sentences.append(
            f"their observations from the same seed differ by {gaps[0]:.1f} at the start and "
            f"{gaps[1]:.1f} at the end, mean over all numbers"
        )
    return tuple(sentences)


def _facts(env: gym.Env[Any, Any]) -> dict[str, str]:
    """Return the properties of a vehicle by name."""
    inner: Any = env.unwrapped
    world: MujocoWorld = inner.world
    model, camera = world.vehicle, world.mount
    turning = model.turning_radius_m
    response: SteeringResponse | None = getattr(inner, "response", None)
    mapped = (
        {}
        if response is None
        else {
            "turn at full steering, the map of waypoints to this body": (
                f"{response.per_metre:.2f} rad/m and {response.per_second:.2f} rad/s"
            )
        }
    )
    return mapped | {
        "vehicle": model.name,
        "moves": "on water" if model.floats else "on land",
        "driven by": " and ".join(sorted(inner.parts)),
        "length": f"{model.length_m:g} m",
        "width": f"{model.width_m:g} m",
        "top speed": f"{model.top_speed_mps:g} m/s",
        "smallest turning radius": f"{turning:.2f} m" if turning else "0, it turns on the spot",
        "camera above the ground": f"{camera.z:g} m",
        "camera's angle below the horizon": f"{math.degrees(camera.pitch_rad):.3g} degrees",
        "camera's angle of view": f"{camera.fovy_deg:g} degrees",
        "place": world.course.world,
        "lenses": " and ".join(world.lenses) or "none",
    }


def _name(env: gym.Env[Any, Any]) -> str:
    """Return the id of a vehicle's env.

    Raises:
        MorphologyError: If it is not a vehicle.
    """
    name = env.spec.id if env.spec else type(env.unwrapped).__name__
    if not (hasattr(env.unwrapped, "world") and hasattr(env.unwrapped, "parts")):
        raise MorphologyError(f"{name} is not a vehicle, so it cannot be compared with one.")
    return name


def _flat(env: gym.Env[Any, Any], seen: Any) -> NDArray[np.float64]:
    """Return an observation as one vector."""
    return np.asarray(gym.spaces.flatten(env.observation_space, seen), np.float64)
