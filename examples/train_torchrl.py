# /// script
# dependencies = ["shapechanger[sim]", "torchrl", "tyro"]
# ///
"""Train a hopper with a longer thigh by TorchRL's PPO."""

import gymnasium as gym
import torch
import tyro
from tensordict.nn import TensorDictModule
from torch import nn
from torchrl.collectors import Collector
from torchrl.envs import Compose, DoubleToFloat, GymWrapper, RewardSum, TransformedEnv
from torchrl.modules import NormalParamExtractor, ProbabilisticActor, TanhNormal, ValueOperator
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value import GAE

from shapechanger import Stretch


def main(steps: int = 40_960) -> None:
    """Train for this many steps."""
    torch.manual_seed(0)
    rollout = min(2048, steps)
    hopper = gym.make("shapechanger/Hopper-v1", body=(Stretch("thigh", 1.2),))
    env = TransformedEnv(GymWrapper(hopper), Compose(DoubleToFloat(), RewardSum()))
    env.set_seed(0)
    inputs = env.observation_spec["observation"].shape[-1]
    outputs = env.action_spec.shape[-1]

    def network(size: int) -> nn.Sequential:
        """Return a network of two hidden layers."""
        return nn.Sequential(
            nn.Linear(inputs, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, size)
        )

    actor = ProbabilisticActor(
        TensorDictModule(
            nn.Sequential(network(2 * outputs), NormalParamExtractor()),
            in_keys=["observation"],
            out_keys=["loc", "scale"],
        ),
        in_keys=["loc", "scale"],
        distribution_class=TanhNormal,
        distribution_kwargs={"low": env.action_spec.space.low, "high": env.action_spec.space.high},
        return_log_prob=True,
        spec=env.action_spec,
    )
    critic = ValueOperator(network(1), in_keys=["observation"])
    advantage = GAE(gamma=0.99, lmbda=0.95, value_network=critic)
    loss = ClipPPOLoss(actor, critic, clip_epsilon=0.2, entropy_coeff=0.0)
    optimizer = torch.optim.Adam(loss.parameters(), lr=3e-4)

    for batch in Collector(env, actor, frames_per_batch=rollout, total_frames=steps):
        ended = batch["next", "done"].squeeze(-1)
        if ended.any():
            print(f"mean return {batch['next', 'episode_reward'][ended].mean():.0f}")
        for _ in range(10):
            with torch.no_grad():
                advantage(batch)
            for part in batch[torch.randperm(rollout)].split(256):
                losses = loss(part)
                total = losses["loss_objective"] + losses["loss_critic"]
                optimizer.zero_grad()
                total.backward()
                nn.utils.clip_grad_norm_(loss.parameters(), 0.5)
                optimizer.step()
    env.close()


if __name__ == "__main__":
    tyro.cli(main)
