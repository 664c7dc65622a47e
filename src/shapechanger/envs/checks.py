"""Check the envs of a vector env, and the arguments of its reset."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final, cast

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import LARGEST_RESET_SEED, SpaceMismatch, VectorEnvError, check_seed

_LONGEST_BODY: Final = 60


def require_boxes(env: gym.Env[Any, Any]) -> None:
    """Require Box spaces.

    Raises:
        VectorEnvError: If a space is not a Box.
    """
    for side, space in (("observation", env.observation_space), ("action", env.action_space)):
        if not isinstance(space, gym.spaces.Box):
            raise VectorEnvError(
                f"The {side} space of a vector env must be a Box, and this is {space}: use "
                "`gymnasium.make_vec` with vectorization_mode='sync'."
            )


def require_same_spaces(envs: Sequence[gym.Env[Any, Any]]) -> None:
    """Require that all envs have the same spaces and layouts.

    Raises:
        SpaceMismatch: If a space, or the names of its numbers, differ from the first env's.
    """
    first = envs[0]
    for number, env in enumerate(envs[1:], 1):
        for side in ("observation", "action"):
            ours, theirs = getattr(first, f"{side}_space"), getattr(env, f"{side}_space")
            names, others = _names(first, side), _names(env, side)
            if ours == theirs and names == others:
                continue
            if ours.shape != theirs.shape:
                how = (
                    f"{_size(theirs)} numbers, and the one of env 0 ({describe_body(first)}) has "
                    f"{_size(ours)}"
                )
            elif names != others:
                apart = next((a, b) for a, b in zip(names, others, strict=True) if a != b)
                how = f"{apart[1]!r}, not {apart[0]!r} like env 0 ({describe_body(first)})"
            else:
                how = f"other bounds than env 0 ({describe_body(first)})"
            raise SpaceMismatch(
                f"The {side} space of env {number} ({describe_body(env)}) has {how}: the envs of a "
                "vector env share their spaces, so make one vector env for each kind of body."
            )


def _names(env: gym.Env[Any, Any], side: str) -> tuple[str, ...]:
    """Return the names of the numbers of a space; empty for an env without layouts."""
    layout = getattr(env.unwrapped, f"{side}_layout", None)
    return () if layout is None else tuple(layout.names)


def _size(space: gym.spaces.Box) -> int:
    return math.prod(space.shape)


def describe_body(env: gym.Env[Any, Any]) -> str:
    """Return the id of an env and its body: the name if it has one, else its edits, shortened."""
    inner: Any = env.unwrapped
    name = type(inner).__name__ if env.spec is None else env.spec.id
    body = getattr(inner, "body", None)
    if body is None:
        return name
    family = getattr(inner, "family", None)
    known: dict[str, Any] = {} if family is None else family.bodies
    for called, edits in known.items():
        if edits == body:
            return f"{name}, body {called}"
    text = str(body)
    shortened = f"{text[:_LONGEST_BODY]}..." if len(text) > _LONGEST_BODY else text
    return f"{name}, body {shortened}"


def one_seed_each(seed: int | Sequence[int | None] | None, num_envs: int) -> list[int | None]:
    """Return one seed per env; a single number counts up from the first env.

    Args:
        seed: A number, one seed per env, or None.
        num_envs: How many envs there are.

    Raises:
        VectorEnvError: If there are not as many seeds as envs, or one is not a whole number from 0
            to 2^63 - 1.
    """
    if seed is None:
        return [None] * num_envs
    given: Any = seed  # Not checked at run time.
    is_one = not isinstance(given, Sequence | np.ndarray) or isinstance(given, str | bytes)
    if is_one or np.ndim(cast("Any", given)) == 0:
        first = check_seed(given, VectorEnvError, largest=LARGEST_RESET_SEED - (num_envs - 1))
        return [first + i for i in range(num_envs)]
    each = cast("Sequence[Any]", given)
    if len(each) != num_envs:
        raise VectorEnvError(f"There are {num_envs} envs and {len(each)} seeds.")
    return [
        None if one is None else check_seed(one, VectorEnvError, largest=LARGEST_RESET_SEED)
        for one in each
    ]


def masked_options(
    options: dict[str, Any] | None, num_envs: int
) -> tuple[NDArray[np.bool_] | None, dict[str, Any] | None]:
    """Split the options of a reset into its mask, None for all envs, and the others.

    Args:
        options: Options, which may contain `reset_mask`.
        num_envs: How many envs there are.

    Raises:
        TypeError: If the mask is not an array of booleans.
        ValueError: If the mask has another shape, or is true nowhere.
    """
    if options is None or "reset_mask" not in options:
        return None, options
    mask = options["reset_mask"]
    if not isinstance(mask, np.ndarray):
        raise TypeError(f"`reset_mask` must be an array of booleans, not a {type(mask).__name__}.")
    given = cast("NDArray[Any]", mask)
    if given.dtype != np.bool_:
        raise TypeError(f"`reset_mask` must be an array of booleans, not of {given.dtype}.")
    if given.shape != (num_envs,):
        raise ValueError(f"`reset_mask` must have the shape ({num_envs},), not {given.shape}.")
    if not given.any():
        raise ValueError("`reset_mask` is true for no env, so nothing would be reset.")
    return given.copy(), {key: value for key, value in options.items() if key != "reset_mask"}
