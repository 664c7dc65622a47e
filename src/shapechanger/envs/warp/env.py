"""A vector env whose worlds live on one device, each with its own body."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, Final, cast

import gymnasium as gym
import numpy as np
import torch
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from torch import Tensor

from shapechanger.envs.checks import masked_options, one_seed_each
from shapechanger.envs.warp.batch import BatchKind, WarpBatch, require_fitting
from shapechanger.envs.warp.bodies import DeviceBody, differing_arrays
from shapechanger.envs.warp.devices import Streams, without_gradients
from shapechanger.envs.warp.reader import Reader
from shapechanger.errors import BadAction, UnknownName, VectorEnvError
from shapechanger.layout import Layout

_OPTIONS: Final = ("bodies", "reset_mask")
# Steps between two looks at whether the memory for contacts and constraints was too small.
_LOOKS_EVERY: Final = 256

Tensors = Tensor | tuple[Tensor, ...]
"""One tensor with a row per world, or one per batch where the spaces of the batches differ."""


class WarpVectorEnv(VectorEnv[Any, Any, Any]):
    """Worlds with individual bodies on one device, stepped with mujoco-warp.

    Observations, rewards and ends are tensors on the device, in single precision; they follow the
    CPU env of the same id, with its constants. Worlds whose bodies have arrays of the same shapes
    form a batch. Where all batches have the same spaces, observations and actions are one tensor
    with a row per world; otherwise a tuple with one tensor per batch, in the order of `batches`.
    Rewards, ends and infos always have one number per world.

    A world whose episode ends starts again in the same step (Gymnasium's autoreset mode
    `SAME_STEP`). `infos["final_obs"]` has the observations before that, and `infos["_final_obs"]`
    which worlds have ended; both are there after each step. A world whose simulation diverges is
    terminated with the reward 0, and is true in `infos["diverged"]`, which is there after each step
    too. The other infos equal the CPU env's: per key a tensor of shape (n,), and under `_key`
    which worlds have it.

    Start states have the distribution of the CPU env, but not its numbers: they depend on the seed
    of the world and on how many episodes it has begun since then, and on nothing else. The body
    that a world draws from a pool depends on the same two numbers.

    A step asks the device one question, whether all actions are finite, and copies nothing to it.

    Args:
        reader: Compiles bodies.
        bodies: The body of each world, None for the reader's; or, with `redraws`, the pool of
            bodies.
        num_envs: How many worlds there are.
        device: Name of the device.
        redraws: Whether `bodies` is a pool, of which each start of an episode draws one.
        limits: How many contacts (`nconmax`) and rows of constraints (`njmax`) a world has memory
            for; as many as it can ever have where a number is missing.
        task_infos: Whether steps and resets return the infos of the CPU env.

    Attributes:
        device: Name of the device.
        batches: The worlds, by the shapes of their arrays.
        made_from: The spec of the CPU env, or None.
        max_episode_steps: Steps after which an episode is truncated; None for never.
        episode_steps: Steps of each world's episode so far, shape (n,); it may be written.
        observation_layout: Name, unit and range of each number of an observation of the first
            batch.
        action_layout: The same of an action.
    """

    observation_space: gym.Space[Any]
    action_space: gym.Space[Any]
    single_observation_space: gym.Space[Any]
    single_action_space: gym.Space[Any]

    @without_gradients()
    def __init__(
        self,
        reader: Reader,
        bodies: Sequence[Any],
        num_envs: int,
        *,
        device: str,
        redraws: bool = False,
        limits: Mapping[str, int] | None = None,
        task_infos: bool = True,
    ) -> None:
        self.num_envs = num_envs
        self.device = device
        self._reader = reader
        self._redraws = redraws
        self._task_infos = task_infos
        self.metadata = {"autoreset_mode": AutoresetMode.SAME_STEP}
        groups = _grouped(reader, [reader.body(body) for body in bodies], num_envs)
        self.batches = tuple(
            WarpBatch(*group, device, redraws=redraws, limits=limits or {}) for group in groups
        )
        self._streams = Streams(len(self.batches), device)
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
        self.max_episode_steps: int | None = (
            None if reader.spec is None else reader.spec.max_episode_steps
        )
        self._seeds = self._per_world(torch.int64)
        self._episodes = self._per_world(torch.int64)
        self.episode_steps = self._per_world(torch.int64)
        self._seeded = self._begun = False
        self._steps = 0

    def _size(self, batch: WarpBatch) -> int:
        return self.num_envs if self._flat else len(batch.numbers)

    def _joined(self, spaces: list[Any]) -> gym.Space[Any]:
        """Return the space of all worlds, or one space per batch."""
        return spaces[0] if self._flat else gym.spaces.Tuple(spaces)

    def _per_world(self, dtype: torch.dtype) -> Tensor:
        return torch.zeros(self.num_envs, dtype=dtype, device=self.device)

    @property
    def bodies(self) -> list[Any]:
        """The edits of each world's body; for a finger its parameters."""
        found: list[Any] = [None] * self.num_envs
        for batch in self.batches:
            known = list(batch.bodies)
            for world, chosen in zip(_numbers(batch.numbers), _numbers(batch.chosen), strict=True):
                found[world] = known[chosen]
        return found

    @without_gradients()
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
            observations of others are of their present state.

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

    def _change_bodies(self, numbers: list[int], bodies: Sequence[Any]) -> None:
        """Give worlds other bodies, after all of them have been compiled and found to fit."""
        if len(bodies) != len(numbers):
            raise VectorEnvError(
                f"There are {len(numbers)} worlds that start again and {len(bodies)} bodies."
            )
        if self._redraws:
            raise VectorEnvError(
                "These worlds draw their bodies from a pool: make the vector env with `bodies` "
                "instead of `pool` to choose them at a reset."
            )
        edits = [self._reader.body(body) for body in bodies]
        new = dict(zip(numbers, edits, strict=True))
        read = {body: self._reader.read(body)[0] for body in dict.fromkeys(edits)}
        homes = {world: batch for batch in self.batches for world in _numbers(batch.numbers)}
        for world, body in new.items():
            require_fitting(homes[world].kind, read[body])
        present = self.bodies
        for batch in dict.fromkeys(homes[world] for world in new):
            each = [new.get(world, present[world]) for world in _numbers(batch.numbers)]
            batch.change_bodies({body: read.get(body) or batch.bodies[body] for body in each}, each)

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
        every = (mask, self._seeds, self._episodes)
        rows = [[self._rows(batch, each) for each in every] for batch in self.batches]
        starts = self._streams.run(
            [partial(batch.start, *row) for batch, row in zip(self.batches, rows, strict=True)]
        )
        self._episodes += mask
        self.episode_steps.masked_fill_(mask, 0)
        infos = self._gathered([info for _, info in starts]) if self._task_infos else {}
        return [seen for seen, _ in starts], infos

    @without_gradients()
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
        if not self._begun:
            raise gym.error.ResetNeeded("No episode is under way: call `reset` first.")
        each = self._checked(actions)
        steps = self._streams.run(
            [partial(batch.step, action) for batch, action in zip(self.batches, each, strict=True)]
        )
        observations = [seen for seen, _, _ in steps]
        rewards = self._gathered_one([outcome.rewards for _, outcome, _ in steps])
        terminated = self._gathered_one([outcome.terminated for _, outcome, _ in steps])
        diverged = self._gathered_one([bad for _, _, bad in steps])
        self.episode_steps += 1
        if self.max_episode_steps is None:
            truncated = torch.zeros_like(terminated)
        else:
            truncated = self.episode_steps >= self.max_episode_steps
        ended = terminated | truncated
        # Whether an episode has ended is not asked: the answer would keep a GPU waiting.
        starts, start_infos = self._start(ended)
        infos: dict[str, Any] = {
            **{"final_obs": self._out(observations), "_final_obs": ended},
            **{"diverged": diverged, "_diverged": diverged},
        }
        if self._task_infos:
            step_infos = self._gathered([outcome.infos for _, outcome, _ in steps])
            final_info = _masked({**step_infos, "diverged": diverged}, ended)
            infos |= {"final_info": final_info, "_final_info": ended}
            infos |= _merged(_masked(step_infos, ~ended), start_infos, ended)
        self._steps += 1
        if self._steps % _LOOKS_EVERY == 0:
            self._warn_of_overflows()
        observations = [
            torch.where(self._rows(batch, ended)[:, None], start, seen)
            for batch, start, seen in zip(self.batches, starts, observations, strict=True)
        ]
        return self._out(observations), rewards, terminated, truncated, infos

    def _warn_of_overflows(self) -> None:
        for batch in self.batches:
            for limit, count in batch.worlds.overflows().items():
                warnings.warn(
                    f"{count} worlds had more contacts or constraints than {limit}="
                    f"{batch.worlds.limits[limit]} has memory for, and their physics is wrong "
                    f"without the others: make the vector env with a larger {limit}.",
                    stacklevel=3,
                )

    def _checked(self, actions: Any) -> list[Tensor]:
        """Return the actions of each batch, on the device.

        Raises:
            BadAction: If they have another shape or are not finite.
        """
        if self._flat:
            whole = self._tensor(actions, (self.num_envs, self.action_layout.size), "")
            each = [self._rows(batch, whole) for batch in self.batches]
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
        bad = [~part.isfinite().all(dim=1) for part in each]
        # The only question to the device in a step, before its physics.
        found = _numbers(torch.stack([one.any() for one in bad]))
        for batch, part, any_bad, one in zip(self.batches, each, found, bad, strict=True):
            if any_bad:
                place = int(one.nonzero()[0, 0])
                raise BadAction(
                    f"The action of world {int(batch.numbers[place])} has numbers that are not "
                    f"finite: {_numbers(part[place])}."
                )
        return each

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

    def _rows(self, batch: WarpBatch, values: Tensor) -> Tensor:
        """Return the rows of a batch; a single batch has all, in the same order."""
        return values if len(self.batches) == 1 else values[batch.numbers]

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

    def _out(self, observations: list[Tensor]) -> Tensors:
        return self._gathered_one(observations) if self._flat else tuple(observations)

    def close_extras(self, **kwargs: Any) -> None:
        """Close the CPU envs that compile bodies."""
        self._reader.close()

    def _require_open(self) -> None:
        if self.closed:
            raise gym.error.ClosedEnvironmentError("This vector env is closed: make another one.")


def _numbers(tensor: Tensor) -> list[Any]:
    """Return the numbers of a tensor of one dimension."""
    return cast("Any", tensor).tolist()


def _grouped(
    reader: Reader, bodies: Sequence[Any], num_envs: int
) -> list[tuple[BatchKind, list[int], dict[Any, DeviceBody], list[Any]]]:
    """Compile bodies, and group worlds that have them in turn by the shapes of their arrays.

    Returns:
        Kind, numbers of the worlds, possible bodies, and the body of each world, of each batch.

    Raises:
        VectorEnvError: If there are fewer worlds than shapes.
    """
    kinds: list[BatchKind] = []
    members: list[dict[Any, DeviceBody]] = []
    for body in dict.fromkeys(bodies):
        read, kind = reader.read(body)
        fitting = (i for i, one in enumerate(kinds) if not differing_arrays(one.first, read))
        place = next(fitting, len(kinds))
        if place == len(kinds):
            kinds.append(kind)
            members.append({})
        members[place][body] = read
    # A pool of more bodies than worlds is spread over them.
    step = max(1, len(bodies) // num_envs)
    each = [bodies[world * step % len(bodies)] for world in range(num_envs)]
    groups: list[tuple[BatchKind, list[int], dict[Any, DeviceBody], list[Any]]] = []
    for kind, known in zip(kinds, members, strict=True):
        worlds = [world for world, body in enumerate(each) if body in known]
        if not worlds:
            raise VectorEnvError(
                f"No world has bodies like {kind.first.name}: the bodies of the pool form "
                f"{len(kinds)} batches, because their arrays differ, and there are {num_envs} "
                "worlds, so make more."
            )
        groups.append((kind, worlds, known, [each[world] for world in worlds]))
    return groups


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
    """Return infos with the infos of other worlds added.

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
