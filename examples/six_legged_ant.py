# /// script
# dependencies = ["shapechanger[sim,learn]", "tyro"]
# ///
"""Make a new family of bodies, ants of six legs, and move a policy of four legs to it."""

from __future__ import annotations

import math
from typing import Any

import gymnasium as gym
import tyro
from stable_baselines3 import PPO

from shapechanger import AddLimb, BodyMap, Cut
from shapechanger.envs.ant import AntEnv
from shapechanger.morphology.families import BodyLike, Family, length_axes, strength_axes

# The legs of the ant point to 45, 135, 225 and 315 degrees. The two new legs point to 0 and 180.
SIX_LEGS = (
    AddLimb("front_left_leg", "_5", math.radians(-45.0)),
    AddLimb("front_right_leg", "_6", math.radians(45.0)),
)
# All names in a copied leg get its suffix.
SHANKS = ("shank_1", "shank_2", "shank_3", "shank_4", "shank_1_5", "shank_2_6")

SIX_LEGGED = Family(
    name="SixLeggedAnt",
    bodies={"SixLeggedAnt": (), "FiveAndAHalf": (Cut("shank_1_5", 0.5),)},
    rig=SIX_LEGS,  # Edits that come before the edits of each body of the family.
    bodies_by_joint={f"ankle_{leg}": f"shank_{leg}" for leg in (1, 2, 3, 4)},
    # Axes along which `Family.sample`, `train --bodies` and the arm `generalist` draw bodies.
    axes=length_axes(SHANKS, 0.6, 1.5) + strength_axes("torso"),
)


class SixLeggedAntEnv(AntEnv):
    """The ant's task with six legs.

    Args:
        body: Name of a body of the family, edits, or their JSON.
        **arguments: All arguments of `AntEnv`.
    """

    family = SIX_LEGGED

    def __init__(self, body: BodyLike = "SixLeggedAnt", **arguments: Any) -> None:
        super().__init__(body, **arguments)


gym.register("SixLeggedAnt-v1", f"{__name__}:SixLeggedAntEnv", max_episode_steps=1000)


def main(steps: int = 200_000) -> None:
    """Train an ant with four legs for this many steps, and run its policy with six legs."""
    four, six = gym.make("shapechanger:shapechanger/Ant-v1"), gym.make("SixLeggedAnt-v1")
    model = PPO("MlpPolicy", four, n_steps=min(steps, 2048), seed=0).learn(steps)
    # The fifth leg copies the first leg, and the sixth leg the second.
    rules = {"*_1_5/motor": "copy *_1/motor", "*_2_6/motor": "copy *_2/motor"}
    layouts = [
        getattr(env.unwrapped, f"{side}_layout")
        for side in ("observation", "action")
        for env in (four, six)
    ]
    body_map = BodyMap.between(*layouts, rules=rules)
    for row in body_map.table():
        if row.side == "action":
            print(row.entry, "<-", row.rule)
    observation, info = six.reset(seed=0)
    for _ in range(min(steps, 1000)):
        action, _ = model.predict(body_map.adapt_observation(observation), deterministic=True)
        observation, _, terminated, truncated, info = six.step(body_map.adapt_action(action))
        if terminated or truncated:
            break
    print(f"six legs came {info['x_position']:.2f} m far")
    for body in ("FiveAndAHalf", SIX_LEGGED.sample(1, seed=1)[0]):
        six.reset(options={"body": body})
        print("another body of the family:", body)


if __name__ == "__main__":
    tyro.cli(main)
