"""Worlds whose bodies have arrays of the same shapes, with their task."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import gymnasium as gym
import mujoco
import numpy as np
import torch
from torch import Tensor

from shapechanger.envs.warp.bodies import DeviceBody, differing_arrays
from shapechanger.envs.warp.tasks import DeviceTask
from shapechanger.envs.warp.worlds import Worlds
from shapechanger.errors import VectorEnvError
from shapechanger.layout import Layout

_MOST_LISTED: Final = 4


class BatchKind(NamedTuple):
    """What the bodies of a batch have in common.

    Attributes:
        first: One of them, with which the others are compared.
        model: Its compiled model.
        task: Its task.
        frame_skip: Physics steps of each `Worlds.step`.
        observation_layout: Name, unit and range of each number of an observation.
        action_layout: Name, unit and range of each number of an action.
        action_space: Space of one action.
    """

    first: DeviceBody
    model: mujoco.MjModel
    task: DeviceTask
    frame_skip: int
    observation_layout: Layout
    action_layout: Layout
    action_space: gym.spaces.Box


def require_fitting(kind: BatchKind, body: DeviceBody) -> None:
    """Require that a body has the arrays of a batch.

    Raises:
        VectorEnvError: If it has not.
    """
    arrays = differing_arrays(kind.first, body)
    if arrays:
        more = f" and {len(arrays) - _MOST_LISTED} more" if len(arrays) > _MOST_LISTED else ""
        raise VectorEnvError(
            f"{body.name} cannot join the batch of {kind.first.name}, because "
            f"{', '.join(arrays[:_MOST_LISTED])}{more} differ: worlds of one batch share these "
            "arrays, so make the vector env with both bodies, which gives it a batch of each."
        )


class DeviceStep(NamedTuple):
    """Results of one step of a batch.

    Attributes:
        observations: Shape (n, size).
        rewards: Shape (n,).
        terminated: Shape (n,).
        diverged: Shape (n,).
        infos: Tensors of shape (n, ...).
    """

    observations: Tensor
    rewards: Tensor
    terminated: Tensor
    diverged: Tensor
    infos: dict[str, Tensor]


class WarpBatch:
    """Worlds that are stepped together.

    Args:
        kind: What their bodies have in common.
        numbers: The number of each world in the vector env, shape (n,).
        bodies: The body of each.
        device: Name of the device.

    Attributes:
        numbers: The number of each world in the vector env, shape (n,).
        worlds: Their physics, with views of positions, velocities and forces.
        observation_layout: Name, unit and range of each number of an observation.
        action_layout: Name, unit and range of each number of an action.
        single_observation_space: Space of one world's observations, float32.
        single_action_space: Space of one world's actions.
    """

    def __init__(
        self, kind: BatchKind, numbers: Tensor, bodies: Sequence[DeviceBody], device: str
    ) -> None:
        self.kind = kind
        self.numbers = numbers
        self._task = kind.task
        self.observation_layout, self.action_layout = kind.observation_layout, kind.action_layout
        size = (kind.observation_layout.size,)
        self.single_observation_space = gym.spaces.Box(-np.inf, np.inf, size, np.float32)
        self.single_action_space = kind.action_space
        self.worlds = Worlds(kind.model, bodies, kind.frame_skip, device, kind.task.contact_forces)
        self._task.attach(kind.model, self.worlds)
        self._constants = {
            name: torch.as_tensor(
                np.stack([body.constants[name] for body in bodies]),
                dtype=kind.task.precision,
                device=device,
            )
            for name in kind.first.constants
        }
        self._before = self._task.place(self.worlds).clone()

    def write(self, places: Tensor, bodies: Sequence[DeviceBody]) -> None:
        """Give worlds other bodies; they must start again afterwards.

        Args:
            places: Their indices in this batch, shape (k,).
            bodies: The body of each.
        """
        self.worlds.write(places, bodies)
        for name, tensor in self._constants.items():
            values = np.stack([body.constants[name] for body in bodies])
            tensor[places] = torch.as_tensor(values, dtype=tensor.dtype, device=tensor.device)

    def step(self, actions: Tensor) -> DeviceStep:
        """Take one step in each world.

        A world whose simulation has diverged is terminated with the reward 0, and put back to its
        pose at rest at once, so that nothing but its own results is lost.

        Args:
            actions: Shape (n, nu).
        """
        worlds, task = self.worlds, self._task
        task.act(worlds, self._constants, actions)
        rewards, terminated, infos = task.outcome(worlds, self._before, actions, self._constants)
        observations = task.observations(worlds)
        self._before = task.place(worlds).clone()
        limit = mujoco.mjMAXVAL
        state = torch.cat([worlds.qpos, worlds.qvel, worlds.qacc], dim=1)
        # Also where a number is not one.
        diverged = ~((state.abs() <= limit).all(dim=1) & observations.isfinite().all(dim=1))
        rewards = torch.where(diverged, 0.0, rewards)
        observations = torch.where(observations.isfinite(), observations, 0.0)
        if bool(diverged.any()):
            worlds.clear(diverged)
            poses = self._constants["init_qpos"].to(worlds.qpos.dtype)
            worlds.qpos[diverged] = poses[diverged]
        return DeviceStep(observations, rewards, terminated | diverged, diverged, infos)

    def start(
        self, mask: Tensor, seeds: Tensor, episodes: Tensor
    ) -> tuple[Tensor, dict[str, Tensor]]:
        """Start an episode in some worlds.

        Args:
            mask: Which worlds, shape (n,).
            seeds: The seed of each world, shape (n,).
            episodes: How many episodes each world has begun, shape (n,).

        Returns:
            Observations, shape (n, size), and infos; only the rows of `mask` are of the start.
        """
        self.worlds.clear(mask)
        self._task.start(self.worlds, self._constants, mask, seeds, episodes)
        return self._started(mask)

    def set_state(self, qpos: Tensor, qvel: Tensor) -> None:
        """Set positions (n, nq) and velocities (n, nv) of all worlds, and clear all else.

        Fingers have more than that: start them with `start`.
        """
        everywhere = torch.ones(self.worlds.count, dtype=torch.bool, device=qpos.device)
        self.worlds.clear(everywhere)
        self.worlds.qpos[:], self.worlds.qvel[:] = qpos, qvel
        self._started(everywhere)

    def _started(self, mask: Tensor) -> tuple[Tensor, dict[str, Tensor]]:
        worlds = self.worlds
        if self._task.start_forces:
            worlds.forward()
        else:
            worlds.kinematics()
        self._before[mask] = self._task.place(worlds)[mask]
        return self._task.observations(worlds), self._task.start_infos(worlds, self._constants)
