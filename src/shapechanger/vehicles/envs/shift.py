"""Certificate of the shift between two vehicles: differences of properties and of driving.

A changed property may have no effect, so both vehicles also drive the same commands.
"""

from __future__ import annotations

import math
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import EmptyShift, MorphologyError
from shapechanger.vehicles.waypoints import SteeringResponse
from shapechanger.vehicles.world import MujocoWorld

# Commands of the rollout: half of the steps straight ahead, the other half to the left.
_HALF, _THROTTLE, _STEERING = 20, 0.5, -0.5


def certify_vehicles(source: gym.Env[Any, Any], target: gym.Env[Any, Any]) -> str:
    """Compare two vehicles, including wrappers, and return the certificate of their shift.

    Both envs are reset and stepped, and remain in the middle of an episode. Raises EmptyShift if
    the rollouts give the same poses, rewards, and first and last observations.
    """
    names = _name(source), _name(target)
    old, new = _facts(source), _facts(target)
    one, two = _drive(source), _drive(target)
    if all(map(np.array_equal, one, two)):
        raise EmptyShift(
            f"{names[0]} and {names[1]} behave the same: equal commands gave equal poses, "
            "rewards, and first and last observations, so there is nothing to transfer."
        )
    changes = [f"  {name}: {old[name]} -> {new[name]}" for name in old if old[name] != new[name]]
    answers = [f"  {sentence}" for sentence in _answers(source, one, two)]
    head = [f"{names[0]} -> {names[1]}", *(["Changes:"] if changes else [])]
    return "\n".join([*head, *changes, "Rollout:", *answers])


def _drive(env: gym.Env[Any, Any]) -> tuple[NDArray[np.float64], ...]:
    """Return poses, x, y and heading, (n, 3), rewards, and the first and last observation."""
    seen, info = env.reset(seed=0)
    observations, path, rewards = [seen], [info["pose"]], list[float]()
    for step in range(2 * _HALF):
        action = np.array([0.0 if step < _HALF else _STEERING, _THROTTLE], np.float32)
        seen, reward, terminated, truncated, info = env.step(action)
        path.append(info["pose"])
        rewards.append(float(reward))
        if terminated or truncated:
            break
    space = env.observation_space
    flat = [np.asarray(gym.spaces.flatten(space, one), float) for one in (*observations, seen)]
    return np.array(path), np.array(rewards), *flat


def _answers(
    source: gym.Env[Any, Any],
    one: tuple[NDArray[np.float64], ...],
    two: tuple[NDArray[np.float64], ...],
) -> list[str]:
    """Describe the differences of two rollouts."""
    has_waypoints = hasattr(source.unwrapped, "response")
    aside, forward = ("bearing", "speed") if has_waypoints else ("steering", "throttle")
    moved, turned = list[float](), list[float]()
    for path, *_ in (one, two):
        half = min(_HALF, len(path) - 1)
        moved.append(float(np.linalg.norm(path[half, :2] - path[0, :2])))
        heading = np.unwrap(path[half:, 2])
        turned.append(math.degrees(heading[-1] - heading[0]))
    sentences = [
        f"straight ahead at a {forward} of {_THROTTLE:g} for {_HALF} steps: {moved[0]:.2f} m -> "
        f"{moved[1]:.2f} m",
        f"then a {aside} of {_STEERING:g} for {_HALF} steps: turned by {turned[0]:.0f} -> "
        f"{turned[1]:.0f} degrees",
    ]
    if one[2].shape == two[2].shape:
        gaps = [np.abs(a - b).mean() for a, b in zip(one[2:], two[2:], strict=True)]
        sentences.append(
            f"their observations from the same seed differ by {gaps[0]:.1f} at the start and "
            f"{gaps[1]:.1f} at the end, mean over all numbers"
        )
    return sentences


def _facts(env: gym.Env[Any, Any]) -> dict[str, str]:
    inner: Any = env.unwrapped
    world: MujocoWorld = inner.world
    model, camera, turning = world.vehicle, world.mount, world.vehicle.turning_radius_m
    response: SteeringResponse | None = getattr(inner, "response", None)
    return {
        "turn at full steering, the map of waypoints to this body": "none"
        if response is None
        else f"{response.per_metre:.2f} rad/m and {response.per_second:.2f} rad/s",
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
    name = env.spec.id if env.spec else type(env.unwrapped).__name__
    if not (hasattr(env.unwrapped, "world") and hasattr(env.unwrapped, "parts")):
        raise MorphologyError(f"{name} is not a vehicle, so it cannot be compared with one.")
    return name
