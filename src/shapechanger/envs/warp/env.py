"""A vector env whose worlds are on one device and may have different bodies."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Final, TypeVar, cast

import gymnasium as gym
import numpy as np
import torch
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from torch import Tensor

from shapechanger.envs.checks import masked_options, one_seed_each
from shapechanger.envs.warp.devices import at_once, without_gradients
from shapechanger.envs.warp.reader import BodyReader, grouped
from shapechanger.envs.warp.worlds import Worlds
from shapechanger.errors import BadAction, VectorEnvError, require_known
from shapechanger.layout import Layout

_OPTIONS: Final = ("bodies", "reset_mask")
_NO_LIMIT: Final = 2**62  # Steps.
# Steps between two checks whether the memory for contacts and constraints was too small.
_LOOKS_EVERY: Final = 256

_Result = TypeVar("_Result")
Tensors = Tensor | tuple[Tensor, ...]
"""One tensor with a row per world, or one per batch if the spaces of the batches differ."""


class WarpVectorEnv(VectorEnv[Any, Any, Any]):
    """Worlds on one device, which may have different bodies, stepped with mujoco-warp.

    Observations, rewards and ends are tensors on the device, the first two in single precision.
    They follow the CPU env of the same id, with its constants. Worlds whose bodies differ only in
    numbers, not in structure, form a batch. Where all batches have the same spaces, observations
    and actions are one tensor with a row per world; otherwise a tuple with one tensor per batch, in
    the order of `batches`. Rewards, ends and infos always have one row per world.

    A world whose episode ends starts again in the same step (Gymnasium's autoreset mode
    `SAME_STEP`). `infos["final_obs"]` has the observations before that, and `infos["_final_obs"]`
    which worlds have ended; both are there after each step. A world whose simulation diverges is
    terminated with the reward 0, and is true in `infos["diverged"]`, which is there after each step
    too. The other infos have the CPU env's keys: per key a tensor with a row per world, and under
    `_key` which worlds have it.

    Start states have the distribution of the CPU env, but not its numbers: apart from the body,
    they depend only on the world's seed and on how many episodes it has begun since it got the
    seed. The body that a world draws from a pool depends on the same two numbers.

    A step waits for the device to check that actions are finite, and copies at most these to it,
    except for `FingerTrack`; every 256th step also waits to check for overflows of the memory.
    `shapechanger.make_vec` makes the env.

    Args:
        reader: Compiles bodies.
        bodies: The body of each world, None for the reader's default; or, with `redraws`, the pool
            of bodies.
        num_envs: Number of worlds.
        device: Name of the device, such as `cuda:0`.
        redraws: Whether `bodies` is a pool, of which each start of an episode draws one.
        limits: The limits `nconmax` and `njmax`; see `make_vec`.
        task_infos: Whether steps return the infos of the CPU env.

    Attributes:
        device: Name of the device.
        batches: The worlds, grouped by the shapes of their arrays.
        made_from: The spec of the CPU env, or None.
        max_episode_steps: Steps after which an episode is truncated; None for never.
        episode_steps: Steps of each world's episode so far, shape (n,); callers may change it.
        observation_layout: Name, unit and range of each number of an observation of the first
            batch.
        action_layout: Name, unit and range of each number of an action of the first batch.
    """

    observation_space: gym.Space[Any]
    action_space: gym.Space[Any]
    single_observation_space: gym.Space[Any]
    single_action_space: gym.Space[Any]

    @without_gradients()
    def __init__(
        self,
        reader: BodyReader,
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
        self.batches = tuple(
            make(device, redraws=redraws, limits=limits or {})
            for make in grouped(reader, [reader.body(body) for body in bodies], num_envs)
        )
        first = self.batches[0]
        self.observation_layout: Layout = first.observation_layout
        self.action_layout: Layout = first.action_layout
        self._flat = all(
            batch.observation_layout.names == first.observation_layout.names
            and batch.action_layout == first.action_layout
            for batch in self.batches
        )
        for side in ("observation", "action"):
            single: list[Any] = [getattr(batch, f"single_{side}_space") for batch in self.batches]
            counts = [num_envs if self._flat else batch.count for batch in self.batches]
            whole = [batch_space(*pair) for pair in zip(single, counts, strict=True)]
            for name, spaces in ((f"single_{side}_space", single), (f"{side}_space", whole)):
                setattr(self, name, spaces[0] if self._flat else gym.spaces.Tuple(spaces))
        self.made_from = reader.spec
        self.max_episode_steps: int | None = getattr(reader.spec, "max_episode_steps", None)
        self._seeds, self._episodes, self.episode_steps = torch.zeros(
            (3, num_envs), dtype=torch.int64, device=device
        )
        self._seeded = self._begun = False
        self._steps = 0

    @property
    def bodies(self) -> list[Any]:
        """The edits of each world's body; for a finger its parameters."""
        found: list[Any] = [None] * self.num_envs
        for batch in self.batches:
            known = list(batch.bodies)
            for world, chosen in zip(_list(batch.numbers), _list(batch.chosen), strict=True):
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
            seed: A number, which is the seed of the first world and counts up from there; or one
                seed or None per world. None continues with the present seeds.
            options: `reset_mask`, an array or a tensor of one boolean per world, selects the worlds
                to reset. `bodies` gives new bodies to these worlds, one each, in their order; each
                must have the arrays of its world's batch.

        Returns:
            The observations of all worlds, and the infos of those that started again. The
                observations of others are of their present state.

        Raises:
            VectorEnvError: If there are not as many seeds as worlds, as many bodies as worlds that
                start, or if a body does not fit its batch; all worlds are unchanged then.
            UnknownName: If there is no such option.
            ResetNeeded: If the mask leaves out worlds that have never been reset.
        """
        self._require_open()
        seeds = one_seed_each(seed, self.num_envs)
        options = dict(options or {})
        require_known("option of reset", _OPTIONS, *options)
        if isinstance(options.get("reset_mask"), Tensor):
            options["reset_mask"] = options["reset_mask"].cpu().numpy()
        mask, _ = masked_options(options, self.num_envs)
        if mask is None:
            mask = np.ones(self.num_envs, np.bool_)
        if not self._begun and not mask.all():
            raise gym.error.ResetNeeded("No episode is under way: call `reset` without a mask.")
        if options.get("bodies") is not None:
            self._change_bodies(np.flatnonzero(mask).tolist(), options["bodies"])
        self._take_seeds(seeds)
        starting = torch.as_tensor(mask, device=self.device)
        observations, infos = self._start(starting)
        self._begun = True
        return self._out(observations), _merged((infos, starting))

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
        new = {i: self._reader.body(body) for i, body in zip(numbers, bodies, strict=True)}
        read = {body: self._reader.read(body)[0] for body in dict.fromkeys(new.values())}
        homes = {world: batch for batch in self.batches for world in _list(batch.numbers)}
        for world, body in new.items():
            homes[world].require_fitting(read[body])
        present = self.bodies
        for batch in dict.fromkeys(homes[world] for world in new):
            each = [new.get(world, present[world]) for world in _list(batch.numbers)]
            batch.change_bodies({body: read.get(body) or batch.bodies[body] for body in each}, each)

    def _take_seeds(self, seeds: list[int | None]) -> None:
        """Take new seeds; a world with a new seed begins with its first episode."""
        if not self._seeded:
            drawn = np.random.SeedSequence().generate_state(self.num_envs, np.uint64) >> 1
            seeds = [int(drawn[i]) if seed is None else seed for i, seed in enumerate(seeds)]
            self._seeded = True
        new = {number: seed for number, seed in enumerate(seeds) if seed is not None}
        where, given = torch.tensor([[*new], [*new.values()]], dtype=torch.int64).to(self.device)
        self._seeds[where], self._episodes[where] = given, 0

    def _start(self, mask: Tensor) -> tuple[list[Tensor], dict[str, Tensor]]:
        """Start an episode in the worlds of a mask, shape (n,).

        Return the observations of each batch, and the infos of all worlds; rows outside the mask
        are of the present state.
        """
        every = mask, self._seeds, self._episodes
        starts = self._each(lambda batch: batch.start(*[self._rows(batch, one) for one in every]))
        self._episodes += mask
        self.episode_steps.masked_fill_(mask, 0)
        infos = self._gathered([info for _, info in starts]) if self._task_infos else {}
        return [seen for seen, _ in starts], infos

    def _each(self, work: Callable[[Worlds], _Result]) -> list[_Result]:
        return at_once([partial(work, batch) for batch in self.batches], self.device)

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
        each = dict(zip(self.batches, self._checked(actions), strict=True))
        steps = self._each(lambda batch: batch.step(each[batch]))
        observations, outcomes, told = map(list, zip(*steps, strict=True))
        rewards, terminated, diverged = self._gathered(outcomes).values()
        self.episode_steps += 1
        limit = self.max_episode_steps
        truncated = self.episode_steps >= (_NO_LIMIT if limit is None else limit)
        ended = terminated | truncated
        # Called even if no episode has ended, because reading `ended` would synchronise the GPU.
        starts, start_infos = self._start(ended)
        infos: dict[str, Any] = {
            **{"final_obs": self._out(observations), "_final_obs": ended},
            **{"diverged": diverged, "_diverged": diverged},
        }
        if self._task_infos:
            during = self._gathered(told)
            final_info = _merged(({**during, "diverged": diverged}, ended))
            infos |= {"final_info": final_info, "_final_info": ended}
            infos |= _merged((during, ~ended), (start_infos, ended))
        self._steps += 1
        if self._steps % _LOOKS_EVERY == 0:
            self._warn_of_overflows()
        present = [
            torch.where(self._rows(batch, ended)[:, None], start, seen)
            for batch, start, seen in zip(self.batches, starts, observations, strict=True)
        ]
        return self._out(present), rewards, terminated, truncated, infos

    def _warn_of_overflows(self) -> None:
        for batch in self.batches:
            if count := batch.overflows():
                limits = " and ".join(f"{name}={most}" for name, most in batch.limits.items())
                warnings.warn(
                    f"{count} worlds had more contacts or constraints than {limits} have memory "
                    "for. Some were left out, so their physics is wrong: raise these numbers.",
                    stacklevel=3,
                )

    def _checked(self, actions: Any) -> list[Tensor]:
        """Return the actions of each batch, on the device, or refuse them."""
        if self._flat:
            whole = self._tensor(actions, (self.num_envs, self.action_layout.size), "")
            each = [self._rows(batch, whole) for batch in self.batches]
        else:
            given = cast("Sequence[Any]", actions if isinstance(actions, list | tuple) else ())
            if len(given) != len(self.batches):
                raise BadAction(
                    f"Actions must be a sequence of {len(self.batches)} tensors, one per batch, "
                    "because the action spaces of the batches differ."
                )
            each = [
                self._tensor(part, (batch.count, batch.action_layout.size), f" of batch {i}")
                for i, (part, batch) in enumerate(zip(given, self.batches, strict=True))
            ]
        finite = torch.cat([part.isfinite().all(dim=1) for part in each])
        if not bool(finite.all()):  # The only synchronisation with the device before the physics.
            place = int((~finite).nonzero()[0, 0])
            world = int(torch.cat([batch.numbers for batch in self.batches])[place])
            rows = [row for part in each for row in _list(part)]
            raise BadAction(
                f"The action of world {world} has numbers that are not finite: {rows[place]}."
            )
        return each

    def _tensor(self, actions: Any, shape: tuple[int, int], which: str) -> Tensor:
        try:
            tensor = torch.as_tensor(actions, device=self.device)
        except (TypeError, ValueError) as error:
            raise BadAction(f"The actions{which} must be a tensor or an array: {error}.") from error
        if tuple(tensor.shape) != shape or tensor.dtype == torch.bool or tensor.is_complex():
            raise BadAction(
                f"The actions{which} must be numbers of shape {shape}, got {tensor.dtype} of shape "
                f"{tuple(tensor.shape)}."
            )
        return tensor.to(torch.float32)

    def _rows(self, batch: Worlds, values: Tensor) -> Tensor:
        """Return the rows of a batch; a single batch has all, in the same order."""
        return values if len(self.batches) == 1 else values[batch.numbers]

    def _gathered(self, parts: list[dict[str, Tensor]]) -> dict[str, Tensor]:
        """Return the rows of all batches as tensors with a row per world."""
        if len(parts) == 1:
            return parts[0]
        found: dict[str, Tensor] = {}
        for name, first in parts[0].items():
            found[name] = first.new_empty((self.num_envs, *first.shape[1:]))
            for batch, part in zip(self.batches, parts, strict=True):
                found[name][batch.numbers] = part[name]
        return found

    def _out(self, observations: list[Tensor]) -> Tensors:
        if not self._flat:
            return tuple(observations)
        return self._gathered([{"seen": seen} for seen in observations])["seen"]

    def close_extras(self, **kwargs: Any) -> None:
        """Close the CPU envs that compile bodies."""
        self._reader.close()

    def _require_open(self) -> None:
        if self.closed:
            raise gym.error.ClosedEnvironmentError("This vector env is closed: make another one.")


def _list(tensor: Tensor) -> list[Any]:
    return cast("Any", tensor).tolist()


def _merged(*parts: tuple[dict[str, Tensor], Tensor]) -> dict[str, Any]:
    """Return pairs of infos and a mask as Gymnasium's infos, with a mask under `_key` of each."""
    found: dict[str, Any] = {}
    for infos, mask in parts:
        for name, value in infos.items():
            there = mask.view(-1, *[1] * (value.dim() - 1))
            others = found.get(name, torch.zeros_like(value))
            found[name] = torch.where(there, value, others)
            found[f"_{name}"] = found[f"_{name}"] | mask if f"_{name}" in found else mask
    return found
