"""What a finger is asked to do, whether it is simulated or stands on a bench."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shapechanger.errors import UnknownName
from shapechanger.layout import Element, Feature

__all__ = [
    "FingerSenses",
    "FingertipReward",
    "features_of_senses",
    "fingertip",
    "fingertip_jacobian",
    "place_features",
]


def fingertip(angles: ArrayLike, phalanges: Sequence[float]) -> NDArray[np.float64]:
    """Place of the fingertip, m, shape (..., 3).

    Args:
        angles: rad, (..., 4).
        phalanges: Lengths of the proximal, middle and distal phalanx, m.
    """
    q = np.asarray(angles, np.float64)
    flexion, abduction = q[..., 0], q[..., 1]
    along, down = _in_plane(q, phalanges)
    ahead = along * np.cos(abduction)
    return np.stack(
        [
            ahead * np.cos(flexion) - down * np.sin(flexion),
            along * np.sin(abduction),
            -ahead * np.sin(flexion) - down * np.cos(flexion),
        ],
        axis=-1,
    )


def fingertip_jacobian(angles: ArrayLike, phalanges: Sequence[float]) -> NDArray[np.float64]:
    """How the fingertip moves with each angle, m/rad, shape (..., 3, 4)."""
    q = np.asarray(angles, np.float64)
    flexion, abduction, middle, end = (q[..., j] for j in range(4))
    along, down = _in_plane(q, phalanges)
    both = middle + end
    zero = np.zeros_like(flexion)
    # (d along, d down) with each angle; and what abduction turns aside.
    end_along, end_down = -phalanges[2] * np.sin(both), phalanges[2] * np.cos(both)
    middle_along = end_along - phalanges[1] * np.sin(middle)
    middle_down = end_down + phalanges[1] * np.cos(middle)
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


def _in_plane(
    q: NDArray[np.float64], phalanges: Sequence[float]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """How far the tip is along the proximal phalanx, and how far towards the palm, m."""
    proximal, middle, distal = phalanges
    both = q[..., 2] + q[..., 3]
    along = proximal + middle * np.cos(q[..., 2]) + distal * np.cos(both)
    return along, middle * np.sin(q[..., 2]) + distal * np.sin(both)


# Distances at which each half of nearness has fallen to its half: one leads the finger there from
# anywhere in its workspace of some ten centimetres, one rewards the last millimetres.
_FAR_M: Final = 0.020
_NEAR_M: Final = 0.002


@dataclass(frozen=True, slots=True)
class FingertipReward:
    """Weights of the terms.

    Attributes:
        nearness: Reward of a second at the right place, 1/s.
        effort: Cost of a second at full tension of all tendons, 1/s.
    """

    nearness: float = 50.0
    effort: float = 1.0

    @classmethod
    def from_weights(cls, weights: Mapping[str, float]) -> FingertipReward:
        """The weights by name; the others keep their default.

        Raises:
            UnknownName: If a name is no weight.
        """
        names = [field.name for field in fields(cls)]
        for name in weights:
            if name not in names:
                raise UnknownName("weight of the reward", name, names)
        return cls(**{name: float(value) for name, value in weights.items()})

    def terms(self, distance: float, effort: float, dt_s: float) -> dict[str, float]:
        """The terms of one step; the reward is their sum.

        Args:
            distance: From the fingertip to where it should be, m, at least 0.
            effort: Mean square of each tension over its largest, 0 to 1.
            dt_s: How long the step was, s.

        Returns:
            `reward_nearness`, above 0 and at most `nearness * dt_s`, and `reward_effort`, at most
            0.
        """
        near = 0.5 / (1.0 + distance / _FAR_M) + 0.5 / (1.0 + distance / _NEAR_M)
        return {
            "reward_nearness": self.nearness * dt_s * near,
            "reward_effort": -self.effort * dt_s * effort,
        }


@dataclass(frozen=True, slots=True)
class FingerSenses:
    """One moment of a finger.

    Attributes:
        angles: Of the joints, rad, (4,).
        velocities: Of the joints, rad/s, (4,).
        tensions: Of the tendons, N, (7,).
        lengths: Of the tendons, as their motors wind them, beyond those of the straight finger, m,
            (7,).
        commands: The newest command, -1 to 1, (7,).
        fingertip: Where the fingertip is by the angles, m, (3,).
    """

    angles: NDArray[np.float64]
    velocities: NDArray[np.float64]
    tensions: NDArray[np.float64]
    lengths: NDArray[np.float64]
    commands: NDArray[np.float64]
    fingertip: NDArray[np.float64]

    def numbers(self) -> NDArray[np.float64]:
        """All of them, (32,), in the order of `features_of_senses`."""
        joints = (self.angles, self.velocities)
        tendons = (self.tensions, self.lengths, self.commands)
        return np.concatenate([*joints, *tendons, self.fingertip])


def features_of_senses(
    joint_names: Sequence[str],
    joint_range: NDArray[np.float64],
    tendon_names: Sequence[str],
    most_tension: Sequence[float],
) -> list[Feature]:
    """A feature for each number of `FingerSenses.numbers`.

    Args:
        joint_names: In the order of the angles.
        joint_range: Lowest and highest angle, rad, (4, 2).
        tendon_names: In the order of the tensions.
        most_tension: Of each tendon, N.
    """
    joints = [(name, Element("joint", name)) for name in joint_names]
    tendons = [(name, Element("tendon", name)) for name in tendon_names]
    ranges = joint_range.tolist()
    return [
        *(
            Feature(f"{name}/angle", "rad", low, high, element)
            for (name, element), (low, high) in zip(joints, ranges, strict=True)
        ),
        *(Feature(f"{name}/velocity", "rad/s", element=element) for name, element in joints),
        *(
            Feature(f"{name}/tension", "N", 0.0, most, element)
            for (name, element), most in zip(tendons, most_tension, strict=True)
        ),
        *(Feature(f"{name}/length", "m", element=element) for name, element in tendons),
        *(Feature(f"{name}/command", "1", -1.0, 1.0, element) for name, element in tendons),
        *place_features("fingertip", Element("body", "distal")),
    ]


def place_features(name: str, element: Element) -> list[Feature]:
    """Three features, `name/x` to `name/z`, m."""
    return [Feature(f"{name}/{axis}", "m", element=element) for axis in "xyz"]
