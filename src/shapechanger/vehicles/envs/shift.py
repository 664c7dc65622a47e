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
        answers=_answers(source, one, two),
        is_empty=one.same_as(two),
    )
    if shift.is_empty and not allow_empty:
        raise EmptyShift(
            f"{names[0]} and {names[1]} behave alike: {_STEPS} steps gave the same frames, places "
            "and rewards, so there is nothing to transfer."
        )
    return shift


class _Rollout(NamedTuple):
    """First and last observation, poses, x, y and heading, (n, 3), and rewards of a vehicle."""

    seen: tuple[NDArray[np.float64], NDArray[np.float64]]
    path: NDArray[np.float64]
    rewards: NDArray[np.float64]

    def same_as(self, other: _Rollout) -> bool:
        """Return whether two rollouts are equal."""
        mine, theirs = (*self.seen, *self[1:]), (*other.seen, *other[1:])
        return all(np.array_equal(one, two) for one, two in zip(mine, theirs, strict=True))

    def moved(self) -> tuple[float, float]:
        """Metres in the first half, and degrees of turn to the left in the second."""
        half = min(_STEPS // 2, len(self.path) - 1)
        turned = np.unwrap(self.path[half:, 2])
        straight_m = float(np.linalg.norm(self.path[half, :2] - self.path[0, :2]))
        return straight_m, math.degrees(float(turned[-1] - turned[0]))


def _drive(env: gym.Env[Any, Any], seed: int) -> _Rollout:
    def flat() -> NDArray[np.float64]:
        return np.asarray(gym.spaces.flatten(env.observation_space, seen), np.float64)

    seen, info = env.reset(seed=seed)
    first, path, rewards = flat(), [info["pose"]], list[float]()
    for step in range(_STEPS):
        steering = 0.0 if step < _STEPS // 2 else _STEERING
        action = np.array([steering, _THROTTLE], np.float32)
        seen, reward, terminated, truncated, info = env.step(action)
        path.append(info["pose"])
        rewards.append(float(reward))
        if terminated or truncated:
            break
    return _Rollout((first, flat()), np.array(path), np.array(rewards))


def _answers(source: gym.Env[Any, Any], one: _Rollout, two: _Rollout) -> tuple[str, ...]:
    has_waypoints = hasattr(source.unwrapped, "response")
    aside, forward = ("bearing", "speed") if has_waypoints else ("steering", "throttle")
    (metres, degrees), (other_metres, other_degrees) = one.moved(), two.moved()
    sentences = [
        f"straight ahead at a {forward} of {_THROTTLE:g} for {_STEPS // 2} steps: "
        f"{metres:.2f} m -> {other_metres:.2f} m",
        f"then a {aside} of {_STEERING:g} for as many: turned by {degrees:.0f} -> "
        f"{other_degrees:.0f} degrees",
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
    facts: dict[str, str] = {}
    if response is not None:
        facts["turn at full steering, the map of waypoints to this body"] = (
            f"{response.per_metre:.2f} rad/m and {response.per_second:.2f} rad/s"
        )
    return facts | {
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
    """Return the id of a vehicle's env."""
    name = env.spec.id if env.spec else type(env.unwrapped).__name__
    if not (hasattr(env.unwrapped, "world") and hasattr(env.unwrapped, "parts")):
        raise MorphologyError(f"{name} is not a vehicle, so it cannot be compared with one.")
    return name
