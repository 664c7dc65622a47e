"""Worlds whose bodies have arrays of the same shapes, with their task."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

import gymnasium as gym
import mujoco
import numpy as np
import torch
from torch import Tensor

from shapechanger.envs.warp.bodies import DeviceBody, differing_arrays
from shapechanger.envs.warp.devices import without_gradients
from shapechanger.envs.warp.noise import uniforms
from shapechanger.envs.warp.tasks import DeviceOutcome, DeviceTask
from shapechanger.envs.warp.worlds import Worlds
from shapechanger.errors import VectorEnvError
from shapechanger.layout import Layout

_MOST_LISTED: Final = 4
# Stream of the random numbers that choose bodies; tasks use those from 0 on.
_BODIES: Final = -1


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


class WarpBatch:
    """Worlds that are stepped together.

    Args:
        kind: What their bodies have in common.
        numbers: The number of each world in the vector env.
        bodies: The bodies that the worlds can have, keyed by their edits.
        each: The edits of each world's body.
        device: Name of the device.
        redraws: Whether each start of an episode draws one of the bodies.
        limits: Memory for contacts and constraints; see `Worlds`.

    Attributes:
        kind: What their bodies have in common.
        numbers: The number of each world in the vector env, shape (n,).
        bodies: The bodies that the worlds can have, keyed by their edits.
        chosen: The body of each world, an index of `bodies`, shape (n,).
        worlds: Their physics, with views of positions, velocities and forces.
        observation_layout: Name, unit and range of each number of an observation.
        action_layout: Name, unit and range of each number of an action.
        single_observation_space: Space of one world's observations, float32.
        single_action_space: Space of one world's actions.
    """

    def __init__(
        self,
        kind: BatchKind,
        numbers: Sequence[int],
        bodies: Mapping[Any, DeviceBody],
        each: Sequence[Any],
        device: str,
        *,
        redraws: bool = False,
        limits: Mapping[str, int],
    ) -> None:
        self.kind = kind
        self.numbers = torch.tensor(numbers, device=device)
        self._task = kind.task
        self.observation_layout, self.action_layout = kind.observation_layout, kind.action_layout
        size = (kind.observation_layout.size,)
        self.single_observation_space = gym.spaces.Box(-np.inf, np.inf, size, np.float32)
        self.single_action_space = kind.action_space
        self.chosen = _places(bodies, each, device)
        self.worlds = Worlds(
            kind.model,
            [*bodies.values()],
            self.chosen,
            kind.frame_skip,
            device,
            kind.task.contact_forces,
            limits,
        )
        self._task.attach(kind.model, self.worlds)
        self._redraws = redraws
        self._hold_constants(bodies)
        self._constants = {name: table[self.chosen] for name, table in self._tables.items()}
        self._before = self._task.place(self.worlds).clone()

    def _hold_constants(self, bodies: Mapping[Any, DeviceBody]) -> None:
        """Keep the numbers of the task of each body on the device."""
        self.bodies = bodies
        rows = [body.constants for body in bodies.values()]
        self._tables = {
            name: torch.as_tensor(
                np.stack([row[name] for row in rows]),
                dtype=self._task.precision,
                device=self.worlds.device,
            )
            for name in rows[0]
        }

    def change_bodies(self, bodies: Mapping[Any, DeviceBody], each: Sequence[Any]) -> None:
        """Replace the bodies that worlds can have; worlds with another one must start again.

        Args:
            bodies: The bodies, keyed by their edits.
            each: The edits of each world's body.
        """
        self.worlds.hold([*bodies.values()])
        self._hold_constants(bodies)
        self._choose(_places(bodies, each, self.worlds.device))

    def _choose(self, chosen: Tensor) -> None:
        self.chosen = chosen
        self.worlds.choose(chosen)
        for name, table in self._tables.items():
            self._constants[name].copy_(table[chosen])

    def step(self, actions: Tensor) -> tuple[Tensor, DeviceOutcome, Tensor]:
        """Take one step in each world.

        A world whose simulation has diverged is terminated with the reward 0, and put back to its
        pose at rest at once, so that nothing but its own results is lost.

        Args:
            actions: Shape (n, nu).

        Returns:
            Observations, shape (n, size); rewards, ends and infos; and which worlds have diverged,
            shape (n,).
        """
        worlds, task, actions = self.worlds, self._task, actions.detach()
        task.act(worlds, self._constants, actions)
        rewards, terminated, infos = task.outcome(worlds, self._before, actions, self._constants)
        observations = task.observations(worlds)
        self._before = task.place(worlds).clone()
        limit = mujoco.mjMAXVAL
        state = torch.cat([worlds.qpos, worlds.qvel, worlds.qacc], dim=1)
        # Also where a number is not one.
        diverged = ~((state.abs() <= limit).all(dim=1) & observations.isfinite().all(dim=1))
        rewards = rewards.masked_fill(diverged, 0.0)
        observations = observations.masked_fill(~observations.isfinite(), 0.0)
        worlds.clear(diverged)
        poses = self._constants["init_qpos"].to(worlds.qpos.dtype)
        worlds.qpos.copy_(torch.where(diverged[:, None], poses, worlds.qpos))
        return observations, DeviceOutcome(rewards, terminated | diverged, infos), diverged

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
        if self._redraws:
            drawn = uniforms(seeds, episodes, _BODIES, 1)[:, 0] * len(self.bodies)
            self._choose(torch.where(mask, drawn.to(torch.int64), self.chosen))
        self._task.start(self.worlds, self._constants, mask, seeds, episodes)
        return self._started(mask)

    @without_gradients()
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
        self._before = torch.where(mask[:, None], self._task.place(worlds), self._before)
        return self._task.observations(worlds), self._task.start_infos(worlds, self._constants)


def _places(bodies: Mapping[Any, DeviceBody], each: Sequence[Any], device: str) -> Tensor:
    """Return the place of each world's body among the bodies, shape (n,)."""
    place = {body: i for i, body in enumerate(bodies)}
    return torch.tensor([place[body] for body in each], device=device)
