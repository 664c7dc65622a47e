"""Make the vector env of a device from an id."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final

import gymnasium as gym

from shapechanger.envs.warp.devices import find_device
from shapechanger.envs.warp.env import WarpVectorEnv
from shapechanger.envs.warp.reader import make_reader
from shapechanger.errors import VectorEnvError

# What an env on a device does not have, with the reason.
_REFUSED: Final = {
    "render_mode": "nothing is drawn on the device; render the same body with gymnasium.make",
    "towards": "a reset draws no body by itself; hand it with options={'bodies': [...]}",
}


def make_warp(
    env_id: str,
    make: Callable[[dict[str, Any]], gym.Env[Any, Any]],
    num_envs: int,
    *,
    device: str | None,
    bodies: Sequence[Any] | None,
    pool: Sequence[Any] | None,
    limits: dict[str, int],
    task_infos: bool,
    arguments: dict[str, Any],
) -> WarpVectorEnv:
    """Make many worlds on a device.

    Args:
        env_id: Full id of the task.
        make: Makes a CPU env of it from arguments.
        num_envs: How many worlds.
        device: Name of the device; None for the first GPU, or the CPU if there is no GPU.
        bodies: One body per world; None for the body of `arguments` in all.
        pool: Bodies of which each start of an episode draws one, instead of `bodies`.
        limits: Contacts (`nconmax`) and rows of constraints (`njmax`) that a world has memory for.
        task_infos: Whether steps and resets return the infos of the CPU env.
        arguments: Arguments of the CPU env.

    Raises:
        UnknownName: If there is no such device or body.
        VectorEnvError: If the task has no batched functions, or an argument has no meaning here.
    """
    for name, reason in _REFUSED.items():
        if arguments.get(name) is not None:
            raise VectorEnvError(f"backend='warp' takes no {name}: {reason}.")
    place = find_device(device)
    reader = make_reader(env_id, make, arguments)
    given: Sequence[Any] = pool or bodies or [None]
    return WarpVectorEnv(
        reader,
        given,
        num_envs,
        device=place,
        redraws=pool is not None,
        limits=limits,
        task_infos=task_infos,
    )
