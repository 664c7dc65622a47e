# /// script
# dependencies = ["shapechanger[sim,learn]", "tyro"]
# ///
"""Train one policy on one pole, and balance other poles with it."""

import gymnasium as gym
import tyro
from stable_baselines3 import PPO

import shapechanger


def mean_return(policy: PPO, env: gym.Env, episodes: int = 3) -> float:
    """Return the mean return of a policy over some episodes."""
    total = 0.0
    for seed in range(episodes):
        observation, _ = env.reset(seed=seed)
        ended = False
        while not ended:
            action, _ = policy.predict(observation, deterministic=True)
            observation, reward, terminated, truncated, _ = env.step(action)
            total += float(reward)
            ended = terminated or truncated
    return total / episodes


def main(steps: int = 25_000) -> None:
    """Train for this many steps."""
    source = gym.make("shapechanger/InvertedPendulum-v1")

    # Each number of an observation has a name, a unit and an owner, in every body.
    for feature in source.unwrapped.observation_layout:
        print(f"{feature.name:16} {feature.unit}")

    # The effects of a longer pole, from both compiled models and a rollout in each.
    print(shapechanger.certify(source, gym.make("shapechanger/BigInvertedPendulum-v1")))

    policy = PPO("MlpPolicy", source, seed=0, n_steps=512, learning_rate=1e-3, device="cpu")
    policy.learn(steps)
    for factor in (0.5, 0.75, 1.0, 1.25, 1.5, 2.0):
        body = (shapechanger.Stretch("pole", factor),)
        target = gym.make("shapechanger/InvertedPendulum-v1", body=body)
        print(f"pole of {0.6 * factor:.2f} m: {mean_return(policy, target):6.1f} of 1000")


if __name__ == "__main__":
    tyro.cli(main)
