"""Compile bodies, and read what a device needs to know about them."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any, Final, Protocol, cast

import gymnasium as gym
from typing_extensions import override

from shapechanger.envs.catalogue import FINGER_ENVS
from shapechanger.envs.checks import describe_body
from shapechanger.envs.warp.batch import BatchKind
from shapechanger.envs.warp.bodies import DeviceBody, device_body
from shapechanger.envs.warp.tasks import DeviceTask, find_device_task
from shapechanger.errors import SpaceMismatch
from shapechanger.morphology import Body
from shapechanger.morphology.families import BodyLike


class Reader(Protocol):
    """Compiles bodies, which compare and hash, and reads what a device needs to know about them.

    Attributes:
        spec: The spec of the CPU env, with its time limit.
    """

    spec: Any

    def body(self, value: Any) -> Any:
        """Return a body as it is kept, such as a tuple of edits; None gives the arguments' body."""
        ...

    def read(self, body: Any) -> tuple[DeviceBody, BatchKind]:
        """Compile a body, and return it with the kind of a batch that begins with it.

        Raises:
            ShapechangerError: If it cannot be built, or not for a device.
        """
        ...

    def close(self) -> None:
        """Close the CPU envs."""
        ...


_READERS: Final[dict[type, Callable[[gym.Env[Any, Any]], Reader]]] = {}


def register_reader(env_class: type, reader: Callable[[gym.Env[Any, Any]], Reader]) -> None:
    """Let a device read the bodies of an env in another way than by their edits.

    Args:
        env_class: Class of the CPU env. Its subclasses do not count: they may change the task.
        reader: Makes the reader from a CPU env.
    """
    _READERS[env_class] = reader


def make_reader(
    env_id: str, make: Callable[[dict[str, Any]], gym.Env[Any, Any]], arguments: dict[str, Any]
) -> Reader:
    """Return the reader of a task's bodies.

    Args:
        env_id: Full id of the task.
        make: Makes a CPU env of it from arguments.
        arguments: Arguments of the CPU env.

    Raises:
        VectorEnvError: If the task has no batched functions.
    """
    first = make(arguments)
    for module in {task.device for task in FINGER_ENVS.values()} - {""}:
        import_module(module)
    reader = _READERS.get(type(first.unwrapped))
    if reader is not None:
        return reader(first)
    return BodyReader(first, find_device_task(first, env_id), make, arguments)


class BodyReader(Reader):
    """Reads the bodies of a family, which CPU envs compile.

    Args:
        first: A CPU env of the task.
        task: Its batched functions.
        make: Makes a CPU env of it from arguments.
        arguments: Arguments of the CPU env.
    """

    def __init__(
        self,
        first: gym.Env[Any, Any],
        task: type[DeviceTask],
        make: Callable[[dict[str, Any]], gym.Env[Any, Any]],
        arguments: dict[str, Any],
    ) -> None:
        self._arguments = arguments
        self._make = make
        self._task = task
        self.spec = first.spec
        # One CPU env for each pair of spaces; it changes its body.
        self._envs: list[Any] = [first.unwrapped]
        self._usual = cast("Body", self._envs[0].body)

    @override
    def body(self, value: BodyLike | None) -> Body:
        return self._usual if value is None else self._envs[0].family.body(value)

    @override
    def read(self, body: Body) -> tuple[DeviceBody, BatchKind]:
        env = self._env_with(body)
        found = device_body(describe_body(env), env.model, self._task.constants(env))
        kind = BatchKind(
            found,
            env.model,
            self._task(env),
            int(env.frame_skip),
            env.observation_layout,
            env.action_layout,
            env.action_space,
        )
        return found, kind

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

    @override
    def close(self) -> None:
        for env in self._envs:
            env.close()
