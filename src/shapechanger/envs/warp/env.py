"""A vector env whose worlds live on one device, each with its own body."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import gymnasium as gym
import numpy as np
import torch
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from torch import Tensor

from shapechanger.bodies.families import BodyLike
from shapechanger.envs.finger.env import FingerLike
from shapechanger.envs.vector.checks import masked_options, one_seed_each
from shapechanger.envs.warp.batch import BatchKind, WarpBatch, require_fitting
from shapechanger.envs.warp.bodies import DeviceBody, differing_arrays
from shapechanger.envs.warp.reader import Reader
from shapechanger.errors import BadAction, UnknownName, VectorEnvError
from shapechanger.layout import Layout

_OPTIONS = ("bodies", "reset_mask")

Tensors = Tensor | tuple[Tensor, ...]
"""One tensor with a row per world, or one per batch where the spaces of the batches differ."""


class WarpVectorEnv(VectorEnv[Any, Any, Any]):
    """Worlds with bodies of their own on one device, stepped with mujoco-warp.

    Observations, rewards and ends are tensors on the device, in single precision; they follow the
    CPU env of the same id, with its constants. Worlds whose bodies have arrays of the same shapes
    form a batch. Where all batches have the same spaces, observations and actions are one tensor
    with a row per world; otherwise a tuple with one tensor per batch, in the order of `batches`.
    Rewards, ends and infos always have one number per world.

    Infos are those of the CPU env: per key a tensor of shape (n,), and under `_key` which worlds
    have it. A world whose simulation diverges is terminated with the reward 0 and `diverged`, as in
    `ThreadVectorEnv`.

    Start states have the distribution of the CPU env, but not its numbers: they depend on the seed
    of the world and on how many episodes it has begun since then, and on nothing else.

    Args:
        reader: Compiles bodies.
        bodies: The body of each world; None for that of the reader.
        device: Name of the device.
        autoreset_mode: When to reset a world whose episode has ended, as in Gymnasium.

    Attributes:
        device: Name of the device.
        batches: The worlds, by the shapes of their arrays.
        bodies: The edits of each world's body; for a finger its parameters.
        made_from: The spec of the CPU env, or None.
        observation_layout: Name, unit and range of each number of an observation of the first
            batch.
        action_layout: The same of an action.
    """

    observation_space: gym.Space[Any]
    action_space: gym.Space[Any]
    single_observation_space: gym.Space[Any]
    single_action_space: gym.Space[Any]

    def __init__(
        self,
        reader: Reader,
        bodies: Sequence[BodyLike | FingerLike | None],
        *,
        device: str,
        autoreset_mode: AutoresetMode = AutoresetMode.NEXT_STEP,
    ) -> None:
        self.num_envs = len(bodies)
        self.device = device
        self._reader = reader
        self._mode = autoreset_mode
        self.metadata = {"autoreset_mode": autoreset_mode}
        self.bodies = [reader.body(body) for body in bodies]
        kinds: list[BatchKind] = []
        members: list[list[int]] = []
        found: dict[Any, tuple[DeviceBody, int]] = {}
        for number, body in enumerate(self.bodies):
            if body not in found:
                read, kind = reader.read(body)
                place = _place_among(kinds, read)
                if place == len(kinds):
                    kinds.append(kind)
                    members.append([])
                found[body] = read, place
            members[found[body][1]].append(number)
        self.batches = tuple(
            WarpBatch(
                kind,
                torch.tensor(numbers, device=device),
                [found[self.bodies[number]][0] for number in numbers],
                device,
            )
            for kind, numbers in zip(kinds, members, strict=True)
        )
        first = self.batches[0]
        self.observation_layout: Layout = first.observation_layout
        self.action_layout: Layout = first.action_layout
        self._flat = all(
            batch.observation_layout.names == first.observation_layout.names
            and batch.action_layout == first.action_layout
            for batch in self.batches
        )
        self.single_observation_space = self._joined(
            [b.single_observation_space for b in self.batches]
        )
        self.single_action_space = self._joined([b.single_action_space for b in self.batches])
        self.observation_space = self._joined(
            [batch_space(b.single_observation_space, self._size(b)) for b in self.batches]
        )
        self.action_space = self._joined(
            [batch_space(b.single_action_space, self._size(b)) for b in self.batches]
        )
        self.made_from = reader.spec
        self._limit = None if reader.spec is None else reader.spec.max_episode_steps
        self._seeds = self._per_world(torch.int64)
        self._episodes = self._per_world(torch.int64)
        self._elapsed = self._per_world(torch.int64)
        self._ended = self._per_world(torch.bool)
        self._seeded = self._begun = False

    def _size(self, batch: WarpBatch) -> int:
        return self.num_envs if self._flat else len(batch.numbers)

    def _joined(self, spaces: list[Any]) -> gym.Space[Any]:
        """Return the space of all worlds, or one space per batch."""
        return spaces[0] if self._flat else gym.spaces.Tuple(spaces)

    def _per_world(self, dtype: torch.dtype) -> Tensor:
        return torch.zeros(self.num_envs, dtype=dtype, device=self.device)

    @property
    def max_episode_steps(self) -> int | None:
        """Steps after which an episode is truncated; None for never."""
        return self._limit

    @property
    def episode_steps(self) -> Tensor:
        """Steps of each world's episode so far, shape (n,); what is written here counts."""
        return self._elapsed

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Tensors, dict[str, Any]]:
        """Start an episode in each world.

        Args:
            seed: A number, which is the seed of the first world, the next of the next; or one seed
                or None per world; None goes on with the present seeds.
            options: `reset_mask`, an array or a tensor of one boolean per world, says which worlds
                start again. `bodies` gives new bodies to the worlds that start again, one each, in
                their order; each must have the arrays of its world's batch.

        Returns:
            The observations of all worlds, and the infos of those that started again. The
            observations of others are those of their present state.

        Raises:
            VectorEnvError: If there are not as many seeds as worlds, as many bodies as worlds that
                start, or if a body does not fit its batch; nothing has changed then.
            UnknownName: If there is no such option.
            ResetNeeded: If the mask leaves out worlds that have never been reset.
        """
        self._require_open()
        seeds = one_seed_each(seed, self.num_envs)
        options = dict(options or {})
        for name in options:
            if name not in _OPTIONS:
                raise UnknownName("option of reset", name, _OPTIONS)
        if isinstance(options.get("reset_mask"), Tensor):
            options["reset_mask"] = cast("Tensor", options["reset_mask"]).cpu().numpy()
        given, options = masked_options(options, self.num_envs)
        if given is not None and not self._begun and not given.all():
            raise gym.error.ResetNeeded("No episode is under way: call `reset` without a mask.")
        chosen = np.arange(self.num_envs) if given is None else np.flatnonzero(given)
        if (options or {}).get("bodies") is not None:
            self._change_bodies(chosen.tolist(), cast("Any", options)["bodies"])
        self._take_seeds(seeds)
        mask = self._per_world(torch.bool)
        mask[torch.as_tensor(chosen, device=self.device)] = True
        observations, infos = self._start(mask)
        self._begun = True
        return self._out(observations), _masked(infos, mask)

    def _change_bodies(self, numbers: list[int], bodies: Sequence[BodyLike | FingerLike]) -> None:
        """Give worlds other bodies, after all of them have been compiled and found to fit."""
        if len(bodies) != len(numbers):
            raise VectorEnvError(
                f"There are {len(numbers)} worlds that start again and {len(bodies)} bodies."
            )
        places = {
            number: (batch, place)
            for batch in self.batches
            for place, number in enumerate(_numbers(batch.numbers))
        }
        edits = [self._reader.body(body) for body in bodies]
        read = {body: self._reader.read(body)[0] for body in dict.fromkeys(edits)}
        for number, body in zip(numbers, edits, strict=True):
            require_fitting(places[number][0].kind, read[body])
        for batch in self.batches:
            mine = [
                (places[number][1], body)
                for number, body in zip(numbers, edits, strict=True)
                if places[number][0] is batch
            ]
            if mine:
                where = torch.tensor([place for place, _ in mine], device=self.device)
                batch.write(where, [read[body] for _, body in mine])
        for number, body in zip(numbers, edits, strict=True):
            self.bodies[number] = body

    def _take_seeds(self, seeds: list[int | None]) -> None:
        """Take new seeds; a world with a new seed begins with its first episode."""
        if not self._seeded:
            drawn = np.random.SeedSequence().generate_state(self.num_envs, np.uint64) >> np.uint64(
                1
            )
            seeds = [int(drawn[i]) if seed is None else seed for i, seed in enumerate(seeds)]
            self._seeded = True
        new = [(number, seed) for number, seed in enumerate(seeds) if seed is not None]
        if new:
            where = torch.tensor([number for number, _ in new], device=self.device)
            self._seeds[where] = torch.tensor([seed for _, seed in new], device=self.device)
            self._episodes[where] = 0

    def _start(self, mask: Tensor) -> tuple[list[Tensor], dict[str, Tensor]]:
        """Start an episode in some worlds.

        Args:
            mask: Which worlds, shape (n,).

        Returns:
            Observations of each batch, and infos of all worlds; rows outside the mask are of the
            present state.
        """
        observations: list[Tensor] = []
        infos: list[dict[str, Tensor]] = []
        for batch in self.batches:
            numbers = batch.numbers
            seen, info = batch.start(mask[numbers], self._seeds[numbers], self._episodes[numbers])
            observations.append(seen)
            infos.append(info)
        self._episodes += mask
        self._elapsed[mask] = 0
        self._ended[mask] = False
        return observations, self._gathered(infos)

    def step(self, actions: Any) -> tuple[Tensors, Tensor, Tensor, Tensor, dict[str, Any]]:
        """Take one step in each world.

        Args:
            actions: A tensor or an array with a row per world; a sequence of one per batch where
                the spaces of the batches differ.

        Returns:
            Observations, rewards, terminations, truncations and infos.

        Raises:
            BadAction: If actions have another shape or are not finite; then no world has stepped.
            ResetNeeded: If a world must be reset first.
            ClosedEnvironmentError: If the vector env is closed.
        """
        self._require_open()
        self._require_running()
        waits = self._mode is AutoresetMode.NEXT_STEP
        waiting = self._ended.clone() if waits else torch.zeros_like(self._ended)
        each = self._checked(actions, waiting)
        steps = [batch.step(action) for batch, action in zip(self.batches, each, strict=True)]
        observations = [step.observations for step in steps]
        rewards = self._gathered_one([step.rewards for step in steps])
        terminated = self._gathered_one([step.terminated for step in steps])
        diverged = self._gathered_one([step.diverged for step in steps]) & ~waiting
        infos = self._gathered([step.infos for step in steps])
        self._elapsed += 1
        truncated = torch.zeros_like(terminated)
        if self._limit is not None:
            truncated = self._elapsed >= self._limit
        rewards = torch.where(waiting, 0.0, rewards)
        terminated, truncated = terminated & ~waiting, truncated & ~waiting
        found = _masked(infos, ~waiting)
        if bool(diverged.any()):
            found |= _masked({"diverged": diverged}, diverged)
        self._ended = terminated | truncated
        if bool(waiting.any()):
            starts, infos = self._start(waiting)
            observations = self._mixed(waiting, starts, observations)
            found = _merged(found, infos, waiting)
        elif self._mode is AutoresetMode.SAME_STEP and bool(self._ended.any()):
            ended = self._ended.clone()
            final = {
                "final_obs": self._out(observations),
                "final_info": {
                    name: value & ended if name.startswith("_") else value
                    for name, value in found.items()
                },
            }
            starts, infos = self._start(ended)
            observations = self._mixed(ended, starts, observations)
            kept = {
                name: value & ~ended if name.startswith("_") else value
                for name, value in found.items()
            }
            found = _merged(kept, infos, ended)
            found |= {**final, "_final_obs": ended, "_final_info": ended}
        return self._out(observations), rewards, terminated, truncated, found

    def _checked(self, actions: Any, ignored: Tensor) -> list[Tensor]:
        """Return the actions of each batch, on the device.

        Raises:
            BadAction: If they have another shape or are not finite.
        """
        if self._flat:
            whole = self._tensor(actions, (self.num_envs, self.action_layout.size), "")
            each = [whole[batch.numbers] for batch in self.batches]
        else:
            given = cast("Sequence[Any]", actions if isinstance(actions, list | tuple) else ())
            if len(given) != len(self.batches):
                raise BadAction(
                    f"Actions are a sequence of {len(self.batches)} tensors, one per batch, "
                    "because the action spaces of the batches differ."
                )
            each = [
                self._tensor(part, (len(batch.numbers), batch.action_layout.size), f" of batch {i}")
                for i, (part, batch) in enumerate(zip(given, self.batches, strict=True))
            ]
        for batch, part in zip(self.batches, each, strict=True):
            bad = ~part.isfinite().all(dim=1) & ~ignored[batch.numbers]
            if bool(bad.any()):
                place = int(bad.nonzero()[0, 0])
                raise BadAction(
                    f"The action of world {int(batch.numbers[place])} has numbers that are not "
                    f"finite: {_numbers(part[place])}."
                )
        return [part.nan_to_num(0.0, 0.0, 0.0) for part in each]

    def _tensor(self, actions: Any, shape: tuple[int, int], which: str) -> Tensor:
        try:
            tensor = torch.as_tensor(actions, device=self.device)
        except (TypeError, ValueError) as error:
            raise BadAction(f"The actions{which} must be a tensor or an array: {error}.") from error
        if tuple(tensor.shape) != shape or tensor.dtype == torch.bool or tensor.is_complex():
            raise BadAction(
                f"The actions{which} are numbers of shape {shape}, got {tensor.dtype} of shape "
                f"{tuple(tensor.shape)}."
            )
        return tensor.to(torch.float32)

    def _gathered_one(self, parts: list[Tensor]) -> Tensor:
        """Return the rows of all batches as one tensor with a row per world."""
        if len(parts) == 1:
            return parts[0]
        whole = parts[0].new_empty((self.num_envs, *parts[0].shape[1:]))
        for batch, part in zip(self.batches, parts, strict=True):
            whole[batch.numbers] = part
        return whole

    def _gathered(self, parts: list[dict[str, Tensor]]) -> dict[str, Tensor]:
        return {name: self._gathered_one([part[name] for part in parts]) for name in parts[0]}

    def _mixed(self, mask: Tensor, new: list[Tensor], old: list[Tensor]) -> list[Tensor]:
        """Return the new rows where the mask is true, and the old ones elsewhere."""
        return [
            torch.where(mask[batch.numbers, None], one, other)
            for batch, one, other in zip(self.batches, new, old, strict=True)
        ]

    def _out(self, observations: list[Tensor]) -> Tensors:
        return self._gathered_one(observations) if self._flat else tuple(observations)

    def close_extras(self, **kwargs: Any) -> None:
        """Close the CPU envs that compile bodies."""
        self._reader.close()

    def _require_open(self) -> None:
        if self.closed:
            raise gym.error.ClosedEnvironmentError("This vector env is closed: make another one.")

    def _require_running(self) -> None:
        if not self._begun:
            raise gym.error.ResetNeeded("No episode is under way: call `reset` first.")
        if self._mode is AutoresetMode.DISABLED and bool(self._ended.any()):
            numbers = ", ".join(str(i) for i in _numbers(self._ended.nonzero().flatten()))
            raise gym.error.ResetNeeded(
                f"The episodes of worlds {numbers} have ended, and nothing resets them in this "
                "mode: call `reset` with options={'reset_mask': terminations | truncations}."
            )


def _numbers(tensor: Tensor) -> list[Any]:
    """Return the numbers of a tensor of one dimension."""
    return cast("Any", tensor).tolist()


def _place_among(kinds: list[BatchKind], body: DeviceBody) -> int:
    """Return the number of the batch that a body fits, or that of a new one."""
    for place, kind in enumerate(kinds):
        if not differing_arrays(kind.first, body):
            return place
    return len(kinds)


def _like(mask: Tensor, value: Tensor) -> Tensor:
    """Return a mask, shape (n,), with as many dimensions as a value, shape (n, ...)."""
    return mask.view(-1, *[1] * (value.dim() - 1))


def _masked(infos: dict[str, Tensor], mask: Tensor) -> dict[str, Any]:
    """Return infos, zero outside of a mask, with the mask under `_key` of each key."""
    found: dict[str, Any] = {}
    for name, value in infos.items():
        found[name] = torch.where(_like(mask, value), value, torch.zeros_like(value))
        found[f"_{name}"] = mask
    return found


def _merged(found: dict[str, Any], infos: dict[str, Tensor], mask: Tensor) -> dict[str, Any]:
    """Return infos with those of other worlds added.

    Args:
        found: Infos with masks.
        infos: Infos of the other worlds.
        mask: Which worlds these are.
    """
    merged = dict(found)
    for name, value in infos.items():
        here = found.get(name, torch.zeros_like(value))
        merged[name] = torch.where(_like(mask, value), value, here)
        merged[f"_{name}"] = found.get(f"_{name}", torch.zeros_like(mask)) | mask
    return merged
