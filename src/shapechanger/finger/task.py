"""The finger's tasks: measurements, forward kinematics and reward, for simulated and real fingers.

Axes: x points to the tip of the straight finger, y to the thumb, z to the back of the hand; the
origin is the knuckle. Flexion and radial abduction are positive. The order of angles is knuckle
flexion, knuckle abduction, middle joint, end joint; the knuckle flexes before it abducts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shapechanger.errors import require_known
from shapechanger.finger.anatomy import (
    JOINT_RANGE,
    JOINTS,
    MOST_TENSION_N,
    PHALANX_LENGTH_M,
    TENDONS,
)
from shapechanger.layout import Element, Feature

POLICIES: Final = {
    task: Path(__file__).parent / "policies" / f"{task}.safetensors" for task in ("reach", "track")
}
"""File of the policy of each task: "reach" for `Finger-v1`, "track" for `FingerTrack-v1`."""


def fingertip(angles: ArrayLike) -> NDArray[np.float64]:
    """Return the position of the fingertip, m, shape (..., 3), at angles, rad, shape (..., 4)."""
    bent = directions(np.asarray(angles, np.float64))
    return np.stack(tip_at([np.cos(a) for a in bent], [np.sin(a) for a in bent]), axis=-1)


def directions(angles: Any) -> tuple[Any, Any, Any, Any]:
    """Return four angles, rad, from joint angles, an array or a tensor of shape (..., 4).

    The four angles are flexion and abduction of the knuckle, and the directions of the middle and
    the distal phalanx relative to the proximal one, each of shape (...).
    """
    return angles[..., 0], angles[..., 1], angles[..., 2], angles[..., 2] + angles[..., 3]


def tip_at(cos: Sequence[Any], sin: Sequence[Any]) -> tuple[Any, Any, Any]:
    """Return x, y and z of the fingertip, m, from the cosines and sines of `directions`."""
    along, down = _in_plane(cos, sin)
    ahead = along * cos[1]
    return (
        ahead * cos[0] - down * sin[0],
        along * sin[1],
        -ahead * sin[0] - down * cos[0],
    )


def fingertip_jacobian(angles: ArrayLike) -> NDArray[np.float64]:
    """Return the Jacobian of the fingertip, m/rad, (..., 3, 4), at angles, rad, (..., 4)."""
    bent = directions(np.asarray(angles, np.float64))
    flexion, abduction, middle, both = bent
    along, down = _in_plane([np.cos(a) for a in bent], [np.sin(a) for a in bent])
    zero = np.zeros_like(flexion)
    # Derivatives of `along` and `down` by the angles of the end and middle joints.
    end_along, end_down = -PHALANX_LENGTH_M[2] * np.sin(both), PHALANX_LENGTH_M[2] * np.cos(both)
    middle_along = end_along - PHALANX_LENGTH_M[1] * np.sin(middle)
    middle_down = end_down + PHALANX_LENGTH_M[1] * np.cos(middle)
    cos, sin = np.cos(flexion), np.sin(flexion)
    ahead = along * np.cos(abduction)
    aside = -along * np.sin(abduction)

    def turned(d_ahead: NDArray[np.float64], d_y: NDArray[np.float64], d_down: NDArray[np.float64]):
        return np.stack([d_ahead * cos - d_down * sin, d_y, -d_ahead * sin - d_down * cos], axis=-1)

    columns = [
        np.stack([-ahead * sin - down * cos, zero, -ahead * cos + down * sin], axis=-1),
        turned(aside, along * np.cos(abduction), zero),
        turned(middle_along * np.cos(abduction), middle_along * np.sin(abduction), middle_down),
        turned(end_along * np.cos(abduction), end_along * np.sin(abduction), end_down),
    ]
    return np.stack(columns, axis=-1)


def _in_plane(cos: Sequence[Any], sin: Sequence[Any]) -> tuple[Any, Any]:
    """Return the tip's distance along the proximal phalanx and towards the palm, m."""
    proximal, middle, distal = PHALANX_LENGTH_M
    along = proximal + middle * cos[2] + distal * cos[3]
    return along, middle * sin[2] + distal * sin[3]


# Distances at which the two terms of nearness have fallen by half, m. The first term guides the
# finger in its whole workspace of some ten centimetres; the second rewards the last millimetres.
_FAR_M: Final = 0.020
_NEAR_M: Final = 0.002


@dataclass(frozen=True, slots=True)
class FingertipReward:
    """Weights of the reward for a fingertip near a point or a path."""

    nearness: float = 50.0  # Reward at the target, 1/s.
    effort: float = 1.0  # Cost of full tension of all tendons, 1/s.
    change: float = 0.0  # Cost of commands that change by 1 in each step, 1/s.

    @classmethod
    def from_weights(cls, weights: Mapping[str, float]) -> FingertipReward:
        """Create the reward from weights that replace the defaults."""
        require_known("weight of the reward", [one.name for one in fields(cls)], *weights)
        return cls(**{name: float(value) for name, value in weights.items()})

    def terms(self, distance: Any, effort: Any, change: Any, dt_s: float) -> dict[str, Any]:
        """Return the terms of one step, as numbers, arrays or tensors; the reward is their sum.

        `distance` is the distance of the fingertip from its target, m; `effort` the mean square of
        the tensions relative to their maxima, 0 to 1; `change` the mean square of the changes of
        the commands, 0 to 4.
        """
        near = 0.5 / (1.0 + distance / _FAR_M) + 0.5 / (1.0 + distance / _NEAR_M)
        return {
            "reward_nearness": self.nearness * dt_s * near,
            "reward_effort": -self.effort * dt_s * effort,
            "reward_change": -self.change * dt_s * change,
        }


@dataclass(frozen=True, slots=True)
class FingerSenses:
    """Measurements of a finger at one time."""

    angles: NDArray[np.float64]  # Joint angles, rad, (4,).
    velocities: NDArray[np.float64]  # Joint velocities, rad/s, (4,).
    tensions: NDArray[np.float64]  # Tendon tensions, N, (7,).
    lengths: NDArray[np.float64]  # Lengths at the motors, relative to the straight finger, m, (7,).
    commands: NDArray[np.float64]  # The newest command, -1 to 1, (7,).
    fingertip: NDArray[np.float64]  # Position computed from `angles`, m, (3,).

    def numbers(self) -> NDArray[np.float64]:
        """Return all numbers, (32,), in the order of `features_of_senses`."""
        joints = (self.angles, self.velocities)
        tendons = (self.tensions, self.lengths, self.commands)
        return np.concatenate([*joints, *tendons, self.fingertip])


def features_of_senses() -> list[Feature]:
    """Return a feature for each number of `FingerSenses.numbers`.

    Angles have the ranges of the anatomy. Tensions range up to the nominal finger's largest ones.
    """
    joints = [(name, Element("joint", name)) for name in JOINTS]
    tendons = [(name, Element("tendon", name)) for name in TENDONS]
    return [
        *(
            Feature(f"{name}/angle", "rad", low, high, element)
            for (name, element), (low, high) in zip(joints, JOINT_RANGE.tolist(), strict=True)
        ),
        *(Feature(f"{name}/velocity", "rad/s", element=element) for name, element in joints),
        *(
            Feature(f"{name}/tension", "N", 0.0, most, element)
            for (name, element), most in zip(tendons, MOST_TENSION_N.tolist(), strict=True)
        ),
        *(Feature(f"{name}/length", "m", element=element) for name, element in tendons),
        *(Feature(f"{name}/command", "1", -1.0, 1.0, element) for name, element in tendons),
        *place_features("fingertip", Element("body", "distal")),
    ]


def place_features(name: str, element: Element) -> list[Feature]:
    """Return the features `name/x`, `name/y` and `name/z`, m, of an element's position."""
    return [Feature(f"{name}/{axis}", "m", element=element) for axis in "xyz"]
