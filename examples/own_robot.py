# /// script
# dependencies = ["shapechanger[sim,learn]", "tyro"]
# ///
"""Train your own robot on your own task, and watch its policy in other bodies."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import gymnasium as gym
import tyro
from stable_baselines3 import PPO

import shapechanger
from shapechanger import Mass, Stretch
from shapechanger.envs.own_tasks import RobotState

DOG = """
<mujoco model="dog">
  <option timestep="0.005"/>
  <default>
    <joint axis="0 1 0" range="-50 50" damping="1" armature=".02"/>
    <geom type="capsule" size=".03" friction="1"/>
    <motor gear="25" ctrlrange="-1 1"/>
  </default>
  <worldbody>
    <geom name="floor" type="plane" size="50 50 1"/>
    <body name="trunk" pos="0 0 .45">
      <freejoint/>
      <geom name="trunk" type="box" size=".25 .12 .04" mass="4"/>
      <body name="front_left" pos=".2 .14 0">
        <joint name="front_left"/><geom name="front_left" fromto="0 0 0 0 0 -.4"/>
      </body>
      <body name="front_right" pos=".2 -.14 0">
        <joint name="front_right"/><geom name="front_right" fromto="0 0 0 0 0 -.4"/>
      </body>
      <body name="back_left" pos="-.2 .14 0">
        <joint name="back_left"/><geom name="back_left" fromto="0 0 0 0 0 -.4"/>
      </body>
      <body name="back_right" pos="-.2 -.14 0">
        <joint name="back_right"/><geom name="back_right" fromto="0 0 0 0 0 -.4"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor joint="front_left"/><motor joint="front_right"/>
    <motor joint="back_left"/><motor joint="back_right"/>
  </actuator>
</mujoco>
"""


class Trot:
    """Task of running forward with a level trunk."""

    def reward(self, robot: RobotState) -> dict[str, float]:
        """Return the terms of the reward; the env adds them up and reports each."""
        return {
            "forward": min(robot.velocity[0], 1.5),
            "level": 0.5 * robot.up,
            "control": -0.05 * float((robot.scaled_action**2).sum()),
        }

    def terminated(self, robot: RobotState) -> bool:
        """Return whether the dog has fallen over."""
        return robot.up < 0.3 or robot.height < 0.2


def distance(model: PPO, env: gym.Env[Any, Any], body: tuple[Any, ...]) -> float:
    """Return the distance that the policy covers in an episode, m."""
    observation, _ = env.reset(seed=0, options={"body": body})
    while True:
        action, _ = model.predict(observation, deterministic=True)
        observation, _, terminated, truncated, info = env.step(action)
        if terminated or truncated:
            return info["x_position"]


def main(steps: int = 200_000) -> None:
    """Train for this many steps."""
    file = Path(tempfile.mkdtemp()) / "dog.xml"
    file.write_text(DOG)
    env = shapechanger.from_mjcf(file, Trot, max_episode_steps=300)
    print("observes", ", ".join(map(str, env.get_wrapper_attr("observation_layout"))))
    model = PPO("MlpPolicy", env, n_steps=min(steps, 2048), seed=0).learn(steps)
    for name, body in {
        "the same dog": (),
        "longer front legs": (Stretch("front_*", 1.2),),
        "a heavy trunk": (Mass("trunk", scale=2.0),),
    }.items():
        print(f"{name}: {distance(model, env, body):.2f} m")


if __name__ == "__main__":
    tyro.cli(main)
