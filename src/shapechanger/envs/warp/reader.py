"""Compile bodies, read their arrays for a device, and group bodies that can share a batch."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from functools import partial
from importlib import import_module
from typing import Any, Final

import gymnasium as gym
import mujoco

from shapechanger.envs.catalogue import ON_DEVICE
from shapechanger.envs.checks import describe_body
from shapechanger.envs.warp.kernels import follow_mujoco
from shapechanger.envs.warp.tasks import DeviceTask
from shapechanger.envs.warp.worlds import DeviceBody, Worlds, device_body, differing_arrays
from shapechanger.errors import SpaceMismatch, VectorEnvError
from shapechanger.morphology import Body

_Make = Callable[[dict[str, Any]], gym.Env[Any, Any]]
MakeWorlds = Callable[..., Worlds]
"""Makes `Worlds` from those arguments of the class that are not bound yet."""


class BodyReader:
    """Compiles bodies of a family with CPU envs, and reads their arrays for a device.

    `make` makes a CPU env of the task from its arguments; `first` is such an env.
    """

    def __init__(
        self,
        task: type[DeviceTask],
        first: gym.Env[Any, Any],
        make: _Make,
        arguments: dict[str, Any],
    ) -> None:
        self.spec = first.spec
        self._task, self._make, self._arguments = task, make, arguments
        # One CPU env for each pair of spaces; its body is changed.
        self._envs: list[Any] = [first.unwrapped]
        self._usual: Body = self._envs[0].body

    def body(self, value: Any) -> Any:
        """Return a body as a hashable value; None gives the body in the arguments."""
        return self._usual if value is None else self._envs[0].family.body(value)

    def read(self, body: Any) -> tuple[DeviceBody, MakeWorlds]:
        """Compile a body, and return it with a maker of batches that use the compiled model."""
        env = self._env_with(body)
        model = env.model
        if model.opt.solver == mujoco.mjtSolver.mjSOL_PGS:
            # mujoco-warp has no PGS. Newton's method solves the same problem, and converges.
            model = copy.copy(model)
            model.opt.solver = mujoco.mjtSolver.mjSOL_NEWTON
        layouts = env.observation_layout, env.action_layout
        found = device_body(describe_body(env), model, self._task.constants_of(env))
        return found, partial(self._task, env, model, int(env.frame_skip), layouts)

    def _env_with(self, body: Body) -> Any:
        for env in self._envs:
            try:
                env._change_body(body)
            except SpaceMismatch:
                continue
            return env
        made: Any = self._make({**self._arguments, "body": body}).unwrapped
        self._envs.append(made)
        return made

    def close(self) -> None:
        """Close the CPU envs."""
        for env in self._envs:
            env.close()


# Makes the reader from a CPU env, a maker of CPU envs and their arguments.
_MakeReader = Callable[[gym.Env[Any, Any], _Make, dict[str, Any]], BodyReader]
_READERS: Final[dict[type, _MakeReader]] = {}


def register_reader(env_class: type, reader: _MakeReader) -> None:
    """Register the reader for a class of envs; subclasses of this class do not use it."""
    _READERS[env_class] = reader


def register_task(env_class: type, task: type[DeviceTask]) -> None:
    """Register the batched functions of a class of envs whose bodies `BodyReader` compiles."""
    register_reader(env_class, partial(BodyReader, task))


def make_reader(env_id: str, make: _Make, arguments: dict[str, Any]) -> BodyReader:
    """Return the reader of a task's bodies.

    Args:
        env_id: Full id of the task.
        make: Makes a CPU env of the task from arguments.
        arguments: Arguments of the first CPU env.

    Raises:
        VectorEnvError: If the task has no batched functions, or mujoco-warp has a wrong version.
    """
    follow_mujoco()
    first = make(arguments)
    for module in dict.fromkeys(entry.device for entry in ON_DEVICE):
        import_module(module)
    reader = _READERS.get(type(first.unwrapped))
    if reader is not None:
        return reader(first, make, arguments)
    raise VectorEnvError(
        f"{env_id} has no batched functions, which backend='warp' needs; these envs have them: "
        f"{', '.join(entry.name for entry in ON_DEVICE)}."
    )


def grouped(reader: BodyReader, bodies: Sequence[Any], num_envs: int) -> list[MakeWorlds]:
    """Compile bodies, assign them to worlds in turn, and group worlds that can share a batch.

    Return a function per group, which makes its `Worlds` from `device`, `redraws` and `limits`.
    """
    kinds: list[tuple[MakeWorlds, dict[Any, DeviceBody]]] = []
    for body in dict.fromkeys(bodies):
        read, make = reader.read(body)
        for _, known in kinds:
            if not differing_arrays(next(iter(known.values())), read):
                known[body] = read
                break
        else:
            kinds.append((make, {body: read}))
    # If there are more bodies than worlds, the worlds begin with bodies spread over the pool.
    step = max(1, len(bodies) // num_envs)
    each = [bodies[world * step % len(bodies)] for world in range(num_envs)]
    groups: list[MakeWorlds] = []
    for make, known in kinds:
        worlds = [world for world, body in enumerate(each) if body in known]
        if not worlds:
            raise VectorEnvError(
                f"No world has bodies like {next(iter(known.values())).name}: the bodies of the "
                f"pool form {len(kinds)} batches, because their arrays differ, and there are "
                f"{num_envs} worlds, so make more."
            )
        groups.append(partial(make, worlds, known, [each[world] for world in worlds]))
    return groups
