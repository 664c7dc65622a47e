"""Check the arguments of envs, and actions before anything steps."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from numbers import Real
from typing import Any, Final, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import BadAction, EnvArgumentError, UnknownName
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
    """Return the actions of many envs as one array of the action space's dtype.

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


# Arguments of Gymnasium's base class that its envs set themselves.
_FIXED: Final = ("self", "arguments", "kwargs", "model_path", "observation_space")


def check_arguments(
    env: type[Any], family: str, own: Mapping[str, Any], arguments: Mapping[str, Any]
) -> None:
    """Refuse arguments of an env that do not exist or have the wrong type.

    Args:
        env: Class of the env; its Gymnasium base class defines the arguments.
        family: Name of the family, for messages.
        own: Arguments of every env that Gymnasium's constructors lack, with their defaults.
        arguments: Arguments keyed by name.

    Raises:
        UnknownName: If there is no such argument.
        EnvArgumentError: If one has the wrong type.
    """
    # `main_body` is a number or a name; MuJoCo refuses an unknown one.
    known: dict[str, Any] = dict(own)
    for base in reversed(env.__mro__):
        if not base.__module__.startswith("gymnasium.envs.mujoco"):
            continue
        parameters = inspect.signature(cast("Any", base).__init__).parameters.values()
        known.update({each.name: each.default for each in parameters if each.name not in _FIXED})
    for name, value in arguments.items():
        if name not in known:
            first = [n for n in inspect.signature(env.__init__).parameters if n not in _FIXED]
            raise UnknownName(f"argument of {family}", name, dict.fromkeys([*first, *known]))
        if name != "main_body" and (expected := _mismatch(known[name], value)):
            raise EnvArgumentError(f"{family}: {name} must be {expected}, got {value!r}.")


def _mismatch(default: Any, value: Any) -> str:
    """Describe the type that a value must have, from the argument's default; empty if it fits."""
    if isinstance(default, bool):
        return "" if isinstance(value, (bool, np.bool_)) else "True or False"
    if isinstance(default, (int, float)):
        is_number = isinstance(value, Real) and value is not True and value is not False
        return "" if is_number else "a number"
    if isinstance(default, tuple):
        pair: list[Any] = [*value] if isinstance(value, (tuple, list, np.ndarray)) else []
        fits = len(pair) == 2 and all(isinstance(each, Real) for each in pair)
        return "" if fits else "two numbers"
    return ""
