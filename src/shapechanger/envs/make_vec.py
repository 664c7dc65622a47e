"""Make a vector env from an id.

Gymnasium calls a vector entry point without its id, and the JSON of a spec needs a string instead
of a function. So each name of the catalogue is also an attribute of this module, such as
`shapechanger.envs.make_vec:BigAnt`, which is `make_vec` with this id.
"""

from __future__ import annotations

import copy as copying
import operator
import os
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Final, Literal, overload

import gymnasium as gym
from gymnasium.vector import AutoresetMode

from shapechanger.contract.env_ref import EnvRef
from shapechanger.envs.catalogue import find
from shapechanger.envs.vector.env import ThreadVectorEnv
from shapechanger.errors import VectorEnvError, require_known

if TYPE_CHECKING:
    from shapechanger.envs.warp.env import WarpVectorEnv

# Reasons why a backend does not have an argument, keyed by the backend and the argument.
_REFUSED: Final = {
    "threads": dict.fromkeys(("device", "pool", "nconmax", "njmax"), "use backend='warp'"),
    "warp": {
        "threads": "all worlds are stepped at once",
        "render_mode": "a device cannot render; render the same body with gymnasium.make",
        "towards": "a reset does not draw bodies; pass them as options={'bodies': [...]}",
    },
}


@overload
def make_vec(
    env_id: str, num_envs: int = 1, *, backend: Literal["threads"] = "threads", **arguments: Any
) -> ThreadVectorEnv: ...


@overload
def make_vec(
    env_id: str, num_envs: int = 1, *, backend: Literal["warp"], **arguments: Any
) -> WarpVectorEnv: ...


def make_vec(
    env_id: str,
    num_envs: int = 1,
    *,
    backend: str = "threads",
    threads: int | None = None,
    device: str | None = None,
    bodies: Sequence[Any] | None = None,
    pool: Sequence[Any] | None = None,
    nconmax: int | None = None,
    njmax: int | None = None,
    task_infos: bool = True,
    autoreset_mode: AutoresetMode | str | None = None,
    copy: bool = True,
    **arguments: Any,
) -> ThreadVectorEnv | WarpVectorEnv:
    """Make a vector env of one id.

    Args:
        env_id: A registered id, or a name of the catalogue, such as `BigAnt`. Envs of other
            classes must not share mutable state, because they step in threads. For an env of a body
            family or of a robot's file, `gymnasium.make_vec` makes the same vector env.
        num_envs: How many envs.
        backend: `threads` steps CPU envs with a few threads; `warp` steps worlds on a device, with
            tensors as results (see `shapechanger.envs.warp.WarpVectorEnv`).
        threads: How many threads step the envs, including the caller's; 1 starts none. None for one
            per core that this process may use; never more than envs. Results do not depend on it.
        device: With the backend `warp`: `cpu`, `cuda:0`, ...; None for the first GPU, or the CPU
            if there is no GPU.
        bodies: One body per env instead of one for all. With threads, lengths and masses may
            differ, but spaces may not; on a device, spaces may differ too. Bodies of fingers, on a
            device only, are their parameters.
        pool: With the backend `warp`, instead of `bodies`: any number of bodies, which are compiled
            once and stay on the device. Each start of an episode draws one of them.
        nconmax: With the backend `warp`: number of contacts that a world has memory for. None for
            the largest possible number; steps are faster with less memory, and a warning is given
            if a world has more contacts.
        njmax: Number of rows of constraints that a world has memory for; otherwise as `nconmax`.
        task_infos: With the backend `warp`: whether steps return the infos of the CPU env, which
            take time and are not used by learners.
        autoreset_mode: When to reset an env whose episode has ended, see Gymnasium; None for
            `NEXT_STEP` with threads, and for `SAME_STEP` on a device, which has no other mode.
        copy: Whether to return copies of the observations; otherwise the next step overwrites them.
            On a device, observations are always copies.
        **arguments: Arguments of `gymnasium.make`, such as `render_mode` or `max_episode_steps`.

    Raises:
        UnknownName: If there is no such env, backend, device, mode or body.
        VectorEnvError: If the number of envs or threads is below one, there are not as many bodies
            as envs, an argument belongs to the other backend, or the task has no functions for a
            device.
        SpaceMismatch: If the spaces of two bodies differ, with the backend `threads`.
        MissingExtra: If the backend `warp` is not installed.
    """
    count = _at_least_one("env", num_envs)
    if bodies is not None and len(bodies) != count:
        raise VectorEnvError(f"There are {count} envs and {len(bodies)} bodies.")
    require_known("backend", _REFUSED, backend)
    mode = _mode(autoreset_mode, backend)
    made_from = env_id if env_id in gym.registry or ":" in env_id else find(env_id).id
    own = {"threads": threads, "device": device, "bodies": bodies, "pool": pool}
    own |= {"nconmax": nconmax, "njmax": njmax}
    recorded: dict[str, Any] = {name: value for name, value in own.items() if value is not None}
    for name, reason in _REFUSED[backend].items():
        if {**arguments, **recorded}.get(name) is not None:
            raise VectorEnvError(f"backend={backend!r} takes no {name}: {reason}.")
    if backend == "warp":
        if not copy:
            raise VectorEnvError("backend='warp' always copies observations.")
        if pool is not None and (bodies is not None or not len(pool)):
            raise VectorEnvError("Give either `bodies`, one per world, or a `pool` of some bodies.")
        from shapechanger.envs.warp import WarpVectorEnv, find_device, make_reader  # An extra.

        limits = {"nconmax": nconmax, "njmax": njmax}
        place = find_device(device)
        envs = WarpVectorEnv(
            make_reader(made_from, lambda given: EnvRef(made_from, given).make(), arguments),
            pool or bodies or [None],
            count,
            device=place,
            redraws=pool is not None,
            limits={k: _at_least_one(k, most) for k, most in limits.items() if most is not None},
            task_infos=task_infos,
        )
        spec = copying.deepcopy(envs.made_from)
        recorded |= {"backend": backend, "task_infos": task_infos}
    else:
        each: list[dict[str, Any]] = [arguments] * count
        if bodies is not None:
            each = [{**arguments, "body": body} for body in bodies]
        cores = _cores() if threads is None else _at_least_one("thread", threads)
        envs = ThreadVectorEnv(
            [EnvRef(made_from, one).make for one in each],
            threads=min(cores, count),
            autoreset_mode=mode,
            copy=copy,
        )
        spec = copying.deepcopy(envs.envs[0].spec)
        recorded["copy"] = copy
    # `gymnasium.make_vec(spec)` repeats this call; it sets the spec of its own results too.
    if spec is not None and spec.vector_entry_point is not None:
        recorded |= {name: list(recorded[name]) for name in recorded.keys() & {"bodies", "pool"}}
        spec.kwargs.update(arguments, num_envs=count, vectorization_mode="vector_entry_point")
        spec.kwargs.update(autoreset_mode=mode.value, **recorded)
        envs.spec = spec
    return envs


def __getattr__(name: str) -> Callable[..., Any]:
    """Return `make_vec` for the env of this name."""
    if name.startswith("_"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return partial(make_vec, name)


def _cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1  # pragma: no cover  # Not Linux.


def _at_least_one(noun: str, number: int) -> int:
    if not hasattr(number, "__index__") or operator.index(number) < 1:
        raise VectorEnvError(f"A vector env needs at least one {noun}, got {number!r}.")
    return operator.index(number)


def _mode(mode: AutoresetMode | str | None, backend: str) -> AutoresetMode:
    usual = AutoresetMode.SAME_STEP if backend == "warp" else AutoresetMode.NEXT_STEP
    known = {one.value: one for one in AutoresetMode}
    name = usual.value if mode is None else str(getattr(mode, "value", mode))
    require_known("autoreset mode", known, name)
    wanted = known[name]
    if backend == "warp" and wanted is not usual:
        raise VectorEnvError(
            f"backend='warp' has no autoreset mode {wanted.value}: its worlds start again in the "
            "step in which their episode ends, autoreset_mode='SameStep'."
        )
    return wanted
