# /// script
# dependencies = ["shapechanger[sim,learn]", "tyro"]
# ///
"""Train an ant with longer shanks by Stable-Baselines3: eight envs, stepped by threads."""

import tyro
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecNormalize

from shapechanger import Stretch
from shapechanger.transfer.learners.vec_env import ThreadVecEnv


def main(steps: int = 500_000) -> None:
    """Train for this many steps."""
    # Equal to `DummyVecEnv` to the last bit, and faster.
    envs = ThreadVecEnv("shapechanger/Ant-v1", 8, body=(Stretch("shank_*", 1.5),))
    envs.seed(0)
    normalised = VecNormalize(envs)
    model = PPO("MlpPolicy", normalised, n_steps=256, batch_size=512, seed=0, device="cpu")
    model.learn(steps)

    # Distance that the ant covers in five seconds, m.
    normalised.training = False
    observation = normalised.reset()
    start = envs.envs[0].unwrapped.data.qpos[0]
    for _ in range(100):
        action, _ = model.predict(observation, deterministic=True)
        observation, _, ended, infos = normalised.step(action)
        if ended[0]:
            break
    print(f"{infos[0]['x_position'] - start:.2f} m forward")
    envs.close()


if __name__ == "__main__":
    tyro.cli(main)
