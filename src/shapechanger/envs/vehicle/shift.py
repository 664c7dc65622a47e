"""What changes from one vehicle to another: what they are, and how they answer the same commands.

What is declared proves nothing, so both drive: a lens that distorts nothing, or a size that nobody
reads, is found out.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple, cast

import gymnasium as gym
import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import EmptyShift, MorphologyError
from shapechanger.worlds.simulation import MujocoWorld

__all__ = ["VehicleShift", "certify_vehicles"]

_STEPS: Final = 40
# What both are told: half of the steps straight on, the other half to the left.
_THROTTLE: Final = 0.5
_STEERING: Final = -0.5


class VehicleShift(msgspec.Struct, frozen=True):
    """What a target does differently from its source.

    Attributes:
        source: Id of the source.
        target: Id of the target.
        changes: What differs of the vehicles, the places and the cameras, a sentence each.
        answers: How both answered the same commands, a sentence each.
        is_empty: Whether they answered alike: the same pictures, places and rewards.
    """

    source: str
    target: str
    changes: tuple[str, ...]
    answers: tuple[str, ...]
    is_empty: bool

    def __str__(self) -> str:
        """The whole certificate as text."""
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
    """Compare two vehicles, and certify what the shift between them is.

    Both are reset and stepped, and left in the midst of an episode. Wrappers count.

    Args:
        source: Where a skill is learned.
        target: Where it moves to.
        seed: Seed of the resets.
        allow_empty: Whether to certify a shift that changes nothing.

    Raises:
        MorphologyError: If one of them is no vehicle.
        EmptyShift: If nothing differs and `allow_empty` is false.
    """
    names = _name(source), _name(target)
    old, new = _facts(source), _facts(target)
    one, two = _drive(source, seed), _drive(target, seed)
    shift = VehicleShift(
        *names,
        changes=tuple(
            f"{what}: {old[what]} -> {new[what]}" for what in old if old[what] != new[what]
        ),
        answers=_answers(one, two),
        is_empty=one.same_as(two),
    )
    if shift.is_empty and not allow_empty:
        raise EmptyShift(
            f"{names[0]} and {names[1]} do the same: {_STEPS} steps gave the same pictures, places "
            "and rewards. There is nothing to transfer across."
        )
    return shift


class _Driven(NamedTuple):
    """What a vehicle did.

    Attributes:
        seen: What it observed first and last.
        path: Where it was at the start and after each step, (n, 3): x, y and heading.
        rewards: What each step was worth.
        straight_m: How far it came in the first half.
        turned_deg: How far it turned to the left in the second half.
    """

    seen: tuple[NDArray[np.float64], NDArray[np.float64]]
    path: NDArray[np.float64]
    rewards: NDArray[np.float64]
    straight_m: float
    turned_deg: float

    def same_as(self, other: _Driven) -> bool:
        """Whether nothing tells the two apart."""
        mine, theirs = (
            (*self.seen, self.path, self.rewards),
            (*other.seen, other.path, other.rewards),
        )
        return all(np.array_equal(one, two) for one, two in zip(mine, theirs, strict=True))


def _drive(env: gym.Env[Any, Any], seed: int) -> _Driven:
    seen, info = env.reset(seed=seed)
    first = _flat(seen)
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
        (first, _flat(seen)),
        way,
        np.array(rewards),
        float(np.linalg.norm(way[half, :2] - way[0, :2])),
        math.degrees(float(turned[-1] - turned[0])),
    )


def _answers(one: _Driven, two: _Driven) -> tuple[str, ...]:
    told = [
        f"straight on at a throttle of {_THROTTLE:g} for {_STEPS // 2} steps: "
        f"{one.straight_m:.2f} m -> {two.straight_m:.2f} m",
        f"then steering {_STEERING:g} for as many: turned by {one.turned_deg:.0f} -> "
        f"{two.turned_deg:.0f} degrees",
    ]
    if one.seen[0].shape == two.seen[0].shape:
        gaps = [float(np.abs(a - b).mean()) for a, b in zip(one.seen, two.seen, strict=True)]
        told.append(
            f"what they see from the same seed differs by {gaps[0]:.1f} at the start and "
            f"{gaps[1]:.1f} at the end, mean over all numbers"
        )
    return tuple(told)


def _facts(env: gym.Env[Any, Any]) -> dict[str, str]:
    """What there is to say of a vehicle, by its name."""
    inner: Any = env.unwrapped
    world: MujocoWorld = inner.world
    model = world.vehicle
    turning = model.turning_radius_m
    return {
        "vehicle": model.name,
        "moves": "on water" if model.floats else "on land",
        "driven by": " and ".join(sorted(inner.parts)),
        "length": f"{model.length_m:g} m",
        "width": f"{model.width_m:g} m",
        "top speed": f"{model.top_speed_mps:g} m/s",
        "smallest turning radius": f"{turning:.2f} m" if turning else "0, it turns on the spot",
        "camera above the ground": f"{model.camera.z:g} m",
        "camera's angle of view": f"{model.camera.fovy_deg:g} degrees",
        "place": world.course.world,
        "wrong with the camera": " and ".join(world.lenses) or "nothing",
    }


def _name(env: gym.Env[Any, Any]) -> str:
    """The id of a vehicle's env.

    Raises:
        MorphologyError: If it is no vehicle.
    """
    name = env.spec.id if env.spec else type(env.unwrapped).__name__
    if not (hasattr(env.unwrapped, "world") and hasattr(env.unwrapped, "parts")):
        raise MorphologyError(f"{name} is no vehicle, so it cannot be compared with one.")
    return name


def _flat(seen: Any) -> NDArray[np.float64]:
    """An observation as one vector; the parts of a dictionary in alphabetical order."""
    if isinstance(seen, dict):
        parts = cast("dict[str, Any]", seen)
        return np.concatenate([_flat(parts[key]) for key in sorted(parts)])
    return np.asarray(seen, np.float64).ravel()
