"""Check arguments and actions of envs, and the envs, seeds and options of vector envs."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from itertools import zip_longest
from numbers import Real
from typing import Any, Final, cast

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import (
    LARGEST_RESET_SEED,
    BadAction,
    EnvArgumentError,
    SpaceMismatch,
    UnknownName,
    VectorEnvError,
    check_seed,
)

# Kinds of NumPy dtypes. As in Gymnasium, batches may be complex, but not boolean.
_NUMBERS: Final = "biuf"
_BATCH_NUMBERS: Final = "iufc"
_LONGEST_BODY: Final = 60


def check_action(env: Any, action: Any) -> NDArray[Any]:
    """Return an action as an array; refuse a wrong type or shape, and infinite or NaN numbers."""
    name = type(env).__name__ if env.spec is None else env.spec.id
    array = _as_array(action, f"{name} takes arrays of numbers as actions")
    expected = (env.action_layout.size,)
    if array.dtype.kind not in _NUMBERS:
        raise BadAction(f"{name} takes numbers as actions, got {array.dtype}.")
    if array.shape != expected:
        raise BadAction(f"{name} takes actions of shape {expected}, got {array.shape}.")
    finite = np.isfinite(array)
    if not finite.all():
        place = int(np.argmin(finite))
        raise BadAction(
            f"{name} takes finite actions, got {array[place]} for "
            f"{env.action_layout.names[place]}, number {place} of the action."
        )
    return array


def check_actions(
    actions: Any, num_envs: int, shape: tuple[int, ...], ignored: NDArray[np.bool_]
) -> NDArray[Any]:
    """Return the actions of many envs as one array, or refuse them.

    Numbers that are not finite are accepted for envs in `ignored`, which are about to be reset.
    """
    given = _as_array(actions, f"Actions must have the shape {shape} each")
    if given.shape != (num_envs, *shape):
        raise BadAction(f"Actions must have the shape {(num_envs, *shape)}, got {given.shape}.")
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


def _as_array(actions: Any, rule: str) -> NDArray[Any]:
    try:
        return np.asarray(actions)
    except ValueError as error:  # Lists of different lengths in a list.
        raise BadAction(f"{rule}: {error}.") from error


# Arguments of Gymnasium's base class that its envs set themselves.
_FIXED: Final = ("self", "arguments", "kwargs", "model_path", "observation_space")


def check_arguments(
    env: type[Any], family: str, own: Mapping[str, Any], arguments: Mapping[str, Any]
) -> None:
    """Refuse arguments that an env does not have, or that have the wrong type.

    The env's Gymnasium base class defines the arguments and their defaults; `own` has more.
    """
    known: dict[str, Any] = dict(own)
    for base in reversed(env.__mro__):
        if base.__module__.startswith("gymnasium.envs.mujoco"):
            parameters = inspect.signature(cast("Any", base).__init__).parameters.values()
            known.update({one.name: one.default for one in parameters if one.name not in _FIXED})
    for name, value in arguments.items():
        if name not in known:
            first = [n for n in inspect.signature(env.__init__).parameters if n not in _FIXED]
            raise UnknownName(f"argument of {family}", name, dict.fromkeys([*first, *known]))
        # `main_body` is a number or a name; MuJoCo refuses an unknown one.
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


def require_same_boxes(envs: Sequence[gym.Env[Any, Any]]) -> None:
    """Require Box spaces, and the same spaces and names of numbers in all envs."""
    for side in ("observation", "action"):
        space, names = _space(envs[0], side)
        for number, env in enumerate(envs):
            other, others = _space(env, side)
            if not isinstance(other, gym.spaces.Box):
                raise VectorEnvError(
                    f"The {side} space of a vector env must be a Box, and this is {other}: use "
                    "`gymnasium.make_vec` with vectorization_mode='sync'."
                )
            if other == space and others == names:
                continue
            apart = [pair for pair in zip_longest(others, names) if len({*pair}) > 1]
            theirs, ours = apart[0] if apart else (f"{other}", f"{space}")
            raise SpaceMismatch(
                f"The {side} space of env {number} ({describe_body(env)}) has {theirs} and not "
                f"{ours} like env 0 ({describe_body(envs[0])}): the envs of a vector env share "
                "their spaces, so make one vector env for each kind of body."
            )


def _space(env: gym.Env[Any, Any], side: str) -> tuple[Any, tuple[str, ...]]:
    """Return a space and the names of its numbers; () for an env without layouts."""
    layout = getattr(env.unwrapped, f"{side}_layout", None)
    return getattr(env, f"{side}_space"), () if layout is None else tuple(layout.names)


def describe_body(env: gym.Env[Any, Any]) -> str:
    """Return the id of an env and its body: the name if it has one, else its edits, shortened."""
    inner: Any = env.unwrapped
    name = type(inner).__name__ if env.spec is None else env.spec.id
    body = getattr(inner, "body", None)
    if body is None:
        return name
    known: dict[str, Any] = getattr(getattr(inner, "family", None), "bodies", {})
    text = next((called for called, edits in known.items() if edits == body), str(body))
    shortened = f"{text[:_LONGEST_BODY]}..." if len(text) > _LONGEST_BODY else text
    return f"{name}, body {shortened}"


def one_seed_each(seed: int | Sequence[int | None] | None, num_envs: int) -> list[int | None]:
    """Return a seed or None per env; a single number is the first env's seed and counts up."""
    if seed is None:
        return [None] * num_envs
    given: Any = seed  # Callers may pass other types.
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
    """Return `options["reset_mask"]`, None for all envs, and the other options."""
    if options is None or "reset_mask" not in options:
        return None, options
    given: Any = options["reset_mask"]
    kind = getattr(given, "dtype", type(given).__name__)
    if kind != np.bool_:
        raise TypeError(f"`reset_mask` must be an array of booleans, not of {kind}.")
    if given.shape != (num_envs,) or not given.any():
        raise ValueError(
            f"`reset_mask` must have the shape ({num_envs},) and select an env, got {given}."
        )
    return given.copy(), {key: value for key, value in options.items() if key != "reset_mask"}
