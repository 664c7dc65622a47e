"""The task of driving: go forward fast, hit nothing, do not get stuck.

The paper of 2017 asks a car to "avoid collisions while maximizing velocity"; its program paid 0.0
for everything. Here each term comes from a quantity that something measured, and a term whose
quantity nothing measures is left out rather than made up.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields

from shapechanger.errors import UnknownName

__all__ = ["DriveReward"]


@dataclass(frozen=True, slots=True)
class DriveReward:
    """Weights of the terms of driving.

    Attributes:
        velocity: Reward for a metre forward, 1/m. The speed is signed, so a metre backwards costs
            as much: an agent that is paid for speed without its sign learns to reverse in circles
            (gym-donkeycar#70).
        collision: Reward for a collision, usually below zero; once for each that is new.
        stall: Reward for a second of pushing without moving, 1/s, usually below zero.
        collision_ends_episode: Whether a collision ends the task.
    """

    velocity: float = 1.0
    collision: float = -10.0
    stall: float = -1.0
    collision_ends_episode: bool = True

    @classmethod
    def from_weights(cls, weights: Mapping[str, float]) -> DriveReward:
        """The weights by name, as a robot's profile has them; the others keep their default.

        Raises:
            UnknownName: If a name is no weight.
        """
        names = [field.name for field in fields(cls)]
        for name in weights:
            if name not in names:
                raise UnknownName("weight of the reward", name, names)
        given = {name: float(value) for name, value in weights.items()}
        ends = bool(given.pop("collision_ends_episode", cls().collision_ends_episode))
        return cls(**given, collision_ends_episode=ends)

    def terms(
        self,
        speed_mps: float | None,
        collided: bool | None,
        stalled: bool | None,
        dt_s: float,
    ) -> dict[str, float]:
        """The terms of one step; the reward is their sum.

        Args:
            speed_mps: Speed along the robot's nose, m/s, below zero backwards; None where nothing
                measures it.
            collided: Whether it hit something since the step before; None where nothing tells.
            stalled: Whether it pushes without moving; None where nothing tells.
            dt_s: How long the step was, s, at least 0.

        Returns:
            `reward_velocity`, `reward_collision` and `reward_stall`, without those whose quantity
            is None. Each is finite where the quantities are.
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
        """Whether the task is over."""
        return self.collision_ends_episode and bool(collided)
