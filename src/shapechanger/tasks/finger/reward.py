"""The reward of a fingertip that should be somewhere, at one point or along a path."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Final

from shapechanger.errors import UnknownName

__all__ = ["FingertipReward"]

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
