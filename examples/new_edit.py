# /// script
# dependencies = ["shapechanger[sim]", "tyro"]
# ///
"""Write an edit of a body that Shapechanger does not have: turn the axes of hinges."""

from __future__ import annotations

import math
from typing import Any

import gymnasium as gym
import mujoco
import numpy as np
import tyro

import shapechanger  # noqa: F401  # Registers the ids.
from shapechanger.errors import MorphologyError
from shapechanger.morphology import Edit, from_json, interpolate, to_json
from shapechanger.morphology.spec import select


class TurnHinge(Edit, frozen=True):
    """Turn the axis of hinges about the vertical of their body.

    Attributes:
        joint: Name or glob of the hinges.
        angle: Turn, rad; positive is counter-clockwise seen from above.
    """

    joint: str
    angle: float

    def check(self) -> None:
        """Refuse an angle that is not finite, when the edit is made."""
        if not math.isfinite(self.angle):
            raise MorphologyError(f"An angle must be finite, got {self.angle}.")

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Turn every matching hinge; `amount` is the fraction of the edit to apply."""
        turn = self.amount * self.angle
        matrix = np.array(
            [
                [math.cos(turn), -math.sin(turn), 0.0],
                [math.sin(turn), math.cos(turn), 0.0],
                [0.0, 0.0, 1.0],
            ]
        )
        for joint in select("joint", self.joint, spec.joints):
            joint.axis = matrix @ joint.axis


def main(steps: int = 200) -> None:
    """Step an ant with turned ankles, and print a certificate of the differences."""
    body = (TurnHinge("ankle_*", math.radians(40.0)),)
    print(to_json(body))
    assert from_json(to_json(body)) == body  # Studies and worker processes store bodies as JSON.
    with (
        gym.make("shapechanger/Ant-v1") as plain,
        gym.make("shapechanger/Ant-v1", body=body) as env,
    ):
        inner: Any = env.unwrapped
        print(inner.certify_shift(plain, env))
        # Reset to the body halfway between the two.
        env.reset(seed=0, options={"body": interpolate((), body, 0.5)})
        print("halfway:", inner.model.joint("ankle_1").axis.round(3))
        env.action_space.seed(0)
        for _ in range(steps):
            _, _, terminated, truncated, _ = env.step(env.action_space.sample())
            if terminated or truncated:
                env.reset()


if __name__ == "__main__":
    tyro.cli(main)
