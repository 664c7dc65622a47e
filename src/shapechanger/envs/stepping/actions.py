"""Refusing actions that no env can take, before anything steps."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import BadAction
from shapechanger.layout import Layout

__all__ = ["ActionTaker", "check_action"]

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
