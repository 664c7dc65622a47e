"""From what a user types to an env."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from typing import Any

import gymnasium as gym

from shapechanger.envs.catalogue import CATALOGUE, find
from shapechanger.errors import UnknownName
from shapechanger.transfer.env_ref import EnvRef

__all__ = ["default_learner", "env_ref", "opened"]


def env_ref(env_id: str, body: str = "") -> EnvRef:
    """The env of an id, with another body if one is given.

    Args:
        env_id: An id of the catalogue, its name alone, or any id registered with Gymnasium.
        body: Name of a body of the env's family, or edits as JSON; empty for the env's own.

    Raises:
        UnknownName: If no env has this id.
    """
    try:
        full = find(env_id).id
    except UnknownName:
        # Envs of others count too, as `module:id` or once registered; `make` looks again.
        if ":" not in env_id and env_id not in gym.registry:
            raise
        full = env_id
    return EnvRef(full, {"body": body} if body else {})


def default_learner(env: EnvRef) -> str:
    """The learner whose settings were tuned on the env's family; that of the ant for any other."""
    entry = CATALOGUE.get(env.id)
    return entry.learner if entry else "ppo-run"


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
