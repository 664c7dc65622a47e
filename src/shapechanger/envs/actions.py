"""Refusing actions that no env can take, before anything steps."""

from __future__ import annotations

from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import BadAction
from shapechanger.layout import Layout

__all__ = ["ActionTaker", "check_action", "checked"]

# Booleans, integers and floats.
_NUMBERS = "biuf"


class ActionTaker(Protocol):
    """An env that names what its actions mean."""

    action_layout: Layout

    @property
    def spec(self) -> Any:
        """The registered spec, or None."""
        ...


def check_action(env: ActionTaker, action: Any) -> NDArray[Any]:
    """The action as an array.

    Raises:
        BadAction: If it is of another shape than the env's actions, or holds what is no finite
            number; the message names the env.
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


def _name(env: ActionTaker) -> str:
    return type(env).__name__ if env.spec is None else str(env.spec.id)


_ACTIONS_NUMBERS: Final = "iufc"  # Kinds of NumPy's types, as letters.


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
    if given.dtype.kind not in _ACTIONS_NUMBERS:
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
