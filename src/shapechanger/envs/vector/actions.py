"""Whether the envs of a vector env can take the actions they are given."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import BadAction

__all__ = ["checked"]

_NUMBERS: Final = "iufc"  # Kinds of NumPy's types, as letters.


def checked(
    actions: Any, num_envs: int, shape: tuple[int, ...], ignored: NDArray[np.bool_]
) -> NDArray[Any]:
    """The actions as one array of their own precision.

    Args:
        actions: One action per env.
        num_envs: How many envs there are.
        shape: The shape of one action.
        ignored: For each env whether its action does not count, as it is about to be reset.

    Raises:
        BadAction: If one has another shape, or numbers that are not finite.
    """
    try:
        given = np.asarray(actions)
        fits = given.shape == (num_envs, *shape)
    except ValueError:  # Rows of several lengths.
        fits = False
    if not fits:
        _refuse_shape(actions, num_envs, shape)
    given = np.asarray(actions)
    if given.dtype.kind not in _NUMBERS:
        raise BadAction(f"Actions are numbers, not of the type {given.dtype}.")
    if not np.logical_and.reduce(np.isfinite(given), axis=None):
        rows = np.isfinite(given).reshape(num_envs, -1).all(axis=1)
        bad = np.flatnonzero(~rows & ~ignored)
        if bad.size:
            raise BadAction(
                f"The action of env {bad[0]} has numbers that are not finite: {given[bad[0]]}."
            )
    return given


def _refuse_shape(actions: Any, num_envs: int, shape: tuple[int, ...]) -> None:
    """Say which action has another shape, or that there are not as many as envs.

    Raises:
        BadAction: Always.
    """
    try:
        count = len(actions)
    except TypeError:
        raise BadAction(
            f"Actions are one row per env, shape {(num_envs, *shape)}; this is {actions!r}."
        ) from None
    if count != num_envs:
        raise BadAction(f"There are {num_envs} envs and {count} actions.")
    for number, action in enumerate(actions):
        if np.shape(action) != shape:
            raise BadAction(
                f"The action of env {number} has shape {np.shape(action)}, not {shape}."
            )
    raise BadAction(f"Actions have the shape {(num_envs, *shape)}.")
