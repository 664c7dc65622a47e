# /// script
# dependencies = ["shapechanger[sim]", "torch", "tyro"]
# ///
"""Learn to balance a long pole with an actor and a critic, in one file like CleanRL's."""

import numpy as np
import torch
import tyro
from torch import nn
from torch.distributions import Normal

import shapechanger

NUM_ENVS = 16
ROLLOUT = 64
GAMMA = 0.99
LAMBDA = 0.95


def main(steps: int = 300_000) -> None:
    """Train for this many steps."""
    torch.manual_seed(0)
    envs = shapechanger.make_vec("BigInvertedPendulum", NUM_ENVS)
    inputs, outputs = envs.single_observation_space.shape[0], envs.single_action_space.shape[0]
    actor = nn.Sequential(nn.Linear(inputs, 64), nn.Tanh(), nn.Linear(64, outputs))
    critic = nn.Sequential(nn.Linear(inputs, 64), nn.Tanh(), nn.Linear(64, 1))
    log_std = nn.Parameter(torch.zeros(outputs))
    optimizer = torch.optim.Adam([*actor.parameters(), *critic.parameters(), log_std], lr=3e-3)

    def tensor(array):
        """Return a float32 tensor of the same shape."""
        return torch.as_tensor(np.asarray(array), dtype=torch.float32)

    observation = tensor(envs.reset(seed=0)[0])
    lengths = np.zeros(NUM_ENVS)
    finished = []
    for update in range(max(1, steps // (NUM_ENVS * ROLLOUT))):
        rollout = []
        for _ in range(ROLLOUT):
            with torch.no_grad():
                action = Normal(actor(observation), log_std.exp()).sample()
            after, reward, terminated, truncated, _ = envs.step(action.clamp(-3.0, 3.0).numpy())
            rollout.append(
                (observation, action, tensor(reward), tensor(terminated), tensor(truncated))
            )
            lengths += 1.0
            for env in np.flatnonzero(terminated | truncated):
                finished.append(lengths[env])
                lengths[env] = 0.0
            observation = tensor(after)

        # Generalised advantages, from the last step to the first (Schulman et al., ICLR 2016).
        with torch.no_grad():
            ahead = critic(observation).squeeze(-1)
            advantage = torch.zeros(NUM_ENVS)
            advantages = []
            for seen, _, reward, terminated, truncated in reversed(rollout):
                value = critic(seen).squeeze(-1)
                error = reward + GAMMA * ahead * (1 - terminated) - value
                advantage = error + GAMMA * LAMBDA * (1 - terminated) * (1 - truncated) * advantage
                advantages.insert(0, advantage)
                ahead = value
        seen = torch.cat([step[0] for step in rollout])
        action = torch.cat([step[1] for step in rollout])
        advantage = torch.cat(advantages)
        goal = advantage + critic(seen).squeeze(-1).detach()
        advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
        log_prob = Normal(actor(seen), log_std.exp()).log_prob(action).sum(-1)
        loss = (
            -(log_prob * advantage).mean() + (critic(seen).squeeze(-1) - goal).pow(2).mean() * 1e-3
        )
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        if update % 40 == 0:
            print(f"update {update}: {np.mean(finished[-50:] or [0]):.0f} steps an episode")
    envs.close()


if __name__ == "__main__":
    tyro.cli(main)
