"""From what a user types to an env."""

from __future__ import annotations

import json
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from typing import Any, Final, cast

import gymnasium as gym

from shapechanger.envs.catalogue import (
    CATALOGUE,
    FINGER_ENVS,
    REMOTE_FINGER,
    VEHICLE_ENVS,
    find,
    find_task,
)
from shapechanger.errors import MorphologyError, StudyError, UnknownName
from shapechanger.headless import require_known_gl
from shapechanger.transfer.env_ref import EnvRef

__all__ = ["asked", "default_learner", "driven", "env_ref", "opened", "options_of", "require_seed"]

# The largest that PyTorch and NumPy both take.
_LARGEST_SEED: Final = 2**32 - 1


def env_ref(env_id: str, body: str = "") -> EnvRef:
    """The env of an id, with another body if one is given.

    Args:
        env_id: An id of the catalogue, its name alone, or any id registered with Gymnasium.
        body: Name of a body of the env's family, or edits as JSON; empty for the env's own.

    Raises:
        UnknownName: If no env has this id.
        MorphologyError: If a body is given to an env that takes none.
        RenderError: If `MUJOCO_GL` keeps every env from being made.
    """
    require_known_gl()
    task = find_task(env_id)
    if task and not body:
        return EnvRef(task)
    try:
        full = task or find(env_id).id
    except UnknownName:
        # Envs of others count too, as `module:id` or once registered; `make` looks again.
        if not _has_module(env_id) and env_id not in gym.registry:
            raise
        full = env_id
    if body and full not in CATALOGUE:
        raise MorphologyError(f"{full} takes no body; these do: {', '.join(CATALOGUE)}.")
    return EnvRef(full, {"body": body} if body else {})


def default_learner(env: EnvRef) -> str:
    """The learner that was tuned on the env's family; that of the ant for any other."""
    if env.id in VEHICLE_ENVS:
        return "cloning"
    if env.id == REMOTE_FINGER:
        return "ppo-rig"
    entry = CATALOGUE.get(env.id) or FINGER_ENVS.get(env.id)
    return entry.learner if entry else "ppo-run"


def driven(env: EnvRef, lenses: Sequence[str] = ()) -> EnvRef:
    """A vehicle's env as studies use it: who runs into something is put back and drives on.

    Args:
        env: Any env; what is no vehicle's stays as it is.
        lenses: What is wrong with its camera.

    Raises:
        StudyError: If it has no camera that anything could be wrong with.
    """
    if env.id not in VEHICLE_ENVS:
        if lenses:
            raise StudyError(f"{env} has no camera; these have one: {', '.join(VEHICLE_ENVS)}.")
        return env
    more: dict[str, Any] = {"put_back": True}
    if lenses:
        more["lenses"] = list(lenses)
    return EnvRef(env.id, {**env.kwargs, **more})


def asked(env: gym.Env[Any, Any], ability: str) -> Any:
    """What an env offers beyond Gymnasium's own, such as "picture".

    Raises:
        MorphologyError: If it does not.
    """
    offered = getattr(env.unwrapped, ability, None)
    if offered is None:
        name = env.spec.id if env.spec else type(env.unwrapped).__name__
        raise MorphologyError(f"{name} offers no {ability}; these envs do: {', '.join(CATALOGUE)}.")
    return offered


@contextmanager
def opened(env: EnvRef, **more: Any) -> Generator[gym.Env[Any, Any]]:
    """An env that is closed again.

    Raises:
        UnknownName: If no env has this id, or its body names what is not there.
    """
    made = env.make(**more)
    try:
        yield made
    finally:
        made.close()


def options_of(given: str, flag: str) -> dict[str, Any]:
    """More arguments of an env, as a user types them.

    Args:
        given: A JSON object; empty for none.
        flag: The option of the command.

    Raises:
        StudyError: If it is no JSON object.
    """
    if not given:
        return {}
    try:
        options = json.loads(given)
    except ValueError as error:
        raise StudyError(f"{flag} are no JSON ({error}), but {given!r}.") from None
    if not isinstance(options, dict):
        raise StudyError(f'{flag} are a JSON object such as {{"robot": "mine"}}, got {given}.')
    return cast("dict[str, Any]", options)


def require_seed(seed: int) -> None:
    """Refuse a seed that not everything random takes.

    Raises:
        StudyError: If it is negative or too large.
    """
    if not 0 <= seed <= _LARGEST_SEED:
        raise StudyError(f"A seed is a whole number from 0 to {_LARGEST_SEED}, got {seed}.")


def _has_module(env_id: str) -> bool:
    """Whether an id is written `module:id`."""
    module, _, name = env_id.partition(":")
    named = all(part.isidentifier() for part in module.split("."))
    return named and bool(name) and ":" not in name
