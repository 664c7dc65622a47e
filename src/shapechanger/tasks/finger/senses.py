"""What a finger senses, simulated or on the bench, and how its observation is laid out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shapechanger.layout import Element, Feature

__all__ = ["FingerSenses", "features_of_senses", "place_features"]


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
