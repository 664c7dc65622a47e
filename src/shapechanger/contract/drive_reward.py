"""The driving task: go forward fast without collisions and without getting stuck.

The paper of the original release (2017) sets the task "avoid collisions while maximizing velocity";
the program of that release returned a reward of 0.0 at every step. Here a term is omitted if its
quantity is not measured.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from shapechanger.errors import require_known


@dataclass(frozen=True, slots=True)
class DriveReward:
    """Weights of the driving reward.

    Attributes:
        velocity: Reward per metre forward, 1/m. The speed is signed, so a metre backwards costs as
            much: rewarded for unsigned speed, an agent learns to reverse in circles
            (gym-donkeycar#70).
        collision: Reward per new collision, usually negative.
        stall: Reward per second of pushing without moving, 1/s, usually negative.
        collision_ends_episode: Whether a collision ends the task.
    """

    velocity: float = 1.0
    collision: float = -10.0
    stall: float = -1.0
    collision_ends_episode: bool = True

    @classmethod
    def from_weights(cls, weights: Mapping[str, float]) -> DriveReward:
        """Create the reward from weights that replace the defaults, keyed by name.

        Raises:
            UnknownName: If there is no such weight.
        """
        kinds: dict[str, Any] = {field.name: type(field.default) for field in fields(cls)}
        require_known("weight of the reward", kinds, *weights)
        return cls(**{name: kinds[name](value) for name, value in weights.items()})

    def terms(
        self, speed_mps: float | None, collided: bool | None, stalled: bool | None, dt_s: float
    ) -> dict[str, float]:
        """Return the terms of one step; the reward is their sum.

        Args:
            speed_mps: Forward speed, m/s, negative backwards; None if it is not measured.
            collided: Whether the robot has collided since the last step; None if unknown.
            stalled: Whether the robot pushes without moving; None if unknown.
            dt_s: Duration of the step, s, at least 0.

        Returns:
            `reward_velocity`, `reward_collision` and `reward_stall`, each only if its quantity is
            not None; finite if the quantities are finite.
        """
        terms: dict[str, float] = {}
        if speed_mps is not None:
            terms["reward_velocity"] = self.velocity * speed_mps * dt_s
        if collided is not None:
            terms["reward_collision"] = self.collision if collided else 0.0
        if stalled is not None:
            terms["reward_stall"] = self.stall * dt_s if stalled else 0.0
        return terms

    def ends(self, collided: bool | None) -> bool:
        """Return whether the episode ends."""
        return self.collision_ends_episode and bool(collided)
