"""What a vector env's `reset` is asked for: one seed per env, and which envs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import VectorEnvError

__all__ = ["masked_options", "one_seed_each"]


def one_seed_each(seed: int | Sequence[int | None] | None, num_envs: int) -> list[int | None]:
    """A seed for each env: a number counts up from the first env.

    Raises:
        VectorEnvError: If there are not as many seeds as envs.
    """
    if seed is None:
        return [None] * num_envs
    if isinstance(seed, int | np.integer):
        return [int(seed) + i for i in range(num_envs)]
    if len(seed) != num_envs:
        raise VectorEnvError(f"There are {num_envs} envs and {len(seed)} seeds.")
    return list(seed)


def masked_options(
    options: dict[str, Any] | None, num_envs: int
) -> tuple[NDArray[np.bool_] | None, dict[str, Any] | None]:
    """Which envs are to be reset, or None for all, and the options for each of them.

    Raises:
        TypeError: If the mask is not an array of booleans.
        ValueError: If the mask has another shape, or is true nowhere.
    """
    if options is None or "reset_mask" not in options:
        return None, options
    mask = options["reset_mask"]
    if not isinstance(mask, np.ndarray):
        raise TypeError(f"`reset_mask` is an array of booleans, not a {type(mask).__name__}.")
    given = cast("NDArray[Any]", mask)
    if given.dtype != np.bool_:
        raise TypeError(f"`reset_mask` is an array of booleans, not of {given.dtype}.")
    if given.shape != (num_envs,):
        raise ValueError(f"`reset_mask` has the shape ({num_envs},), not {given.shape}.")
    if not given.any():
        raise ValueError("`reset_mask` is true for no env, so nothing would be reset.")
    return given.copy(), {key: value for key, value in options.items() if key != "reset_mask"}
