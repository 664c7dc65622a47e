"""Check actions before anything steps."""

from __future__ import annotations

from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import BadAction
from shapechanger.layout import Layout

# Kinds of NumPy dtypes: booleans, integers and floats; a batch refuses booleans, as Gymnasium.
_NUMBERS: Final = "biuf"
_BATCH_NUMBERS: Final = "iufc"


class NamedEnv(Protocol):
    """An env that names the numbers of its actions."""

    action_layout: Layout

    @property
    def spec(self) -> Any:
        """The registered spec, or None."""
        ...


def check_action(env: NamedEnv, action: Any) -> NDArray[Any]:
    """Return an action as an array.

    Args:
        env: The env that takes it.
        action: The action, of any dtype.

    Raises:
        BadAction: If it has another shape than the env's actions, or a number that is not finite.
    """
    try:
        array = np.asarray(action)
    except ValueError as error:  # Lists of different lengths in a list.
        raise BadAction(f"{_name(env)} takes arrays of numbers as actions: {error}.") from error
    expected = (env.action_layout.size,)
    if array.dtype.kind not in _NUMBERS:
        raise BadAction(f"{_name(env)} takes numbers as actions, got {array.dtype}.")
    if array.shape != expected:
        raise BadAction(f"{_name(env)} takes actions of shape {expected}, got {array.shape}.")
    finite = np.isfinite(array)
    if not finite.all():
        place = int(np.argmin(finite))
        raise BadAction(
            f"{_name(env)} takes finite actions, got {array[place]} for "
            f"{env.action_layout.names[place]}, number {place} of the action."
        )
    return array


def _name(env: NamedEnv) -> str:
    return type(env).__name__ if env.spec is None else str(env.spec.id)


def check_actions(
    actions: Any, num_envs: int, shape: tuple[int, ...], ignored: NDArray[np.bool_]
) -> NDArray[Any]:
    """Return the actions of many envs as one array of their own dtype.

    Args:
        actions: One action per env.
        num_envs: How many envs there are.
        shape: Shape of one action.
        ignored: Whether the action of each env is ignored, because the env is about to be reset.

    Raises:
        BadAction: If one has another shape or a number that is not finite.
    """
    try:
        given = np.asarray(actions)
    except ValueError:  # Rows of several lengths.
        given = None
    if given is None or given.shape != (num_envs, *shape):
        raise BadAction(_wrong_shape(actions, num_envs, shape))
    if given.dtype.kind not in _BATCH_NUMBERS:
        raise BadAction(f"Actions must be numbers, got {given.dtype}.")
    if not np.logical_and.reduce(np.isfinite(given), axis=None):
        rows = np.isfinite(given).reshape(num_envs, -1).all(axis=1)
        bad = np.flatnonzero(~rows & ~ignored)
        if bad.size:
            raise BadAction(
                f"The action of env {bad[0]} has numbers that are not finite: {given[bad[0]]}."
            )
    return given


def _wrong_shape(actions: Any, num_envs: int, shape: tuple[int, ...]) -> str:
    """Describe which action has another shape, or how many actions are missing."""
    try:
        count = len(actions)
    except TypeError:
        return f"Actions are one row per env, shape {(num_envs, *shape)}; this is {actions!r}."
    if count != num_envs:
        return f"There are {num_envs} envs and {count} actions."
    for number, action in enumerate(actions):
        if np.shape(action) != shape:
            return f"The action of env {number} has shape {np.shape(action)}, not {shape}."
    return f"Actions have the shape {(num_envs, *shape)}."
