"""The infos of many envs as one dictionary of arrays, with a mask for each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

__all__ = ["batched"]

# For each key one entry per env, and under the key with a `_` before it whether the env has one.
Batch = dict[str, Any]

_Infos = Sequence[Mapping[str, Any]]


def batched(infos: _Infos) -> Batch:
    """The infos of all envs, as Gymnasium's vector envs give them.

    Gymnasium adds one env after another and each key by itself. Envs whose infos have the same keys
    are added together here, for a tenth of the time.

    Args:
        infos: The info of each env.
    """
    batch: Batch = {}
    _extend(batch, infos, range(len(infos)), len(infos))
    return batch


def _extend(batch: Batch, infos: _Infos, numbers: Sequence[int], num_envs: int) -> None:
    """Add the infos of the envs `numbers` to arrays for `num_envs`."""
    groups: dict[tuple[str, ...], list[int]] = {}
    for place, info in enumerate(infos):
        groups.setdefault(tuple(info), []).append(place)
    for keys, places in groups.items():
        ours = [numbers[place] for place in places]
        columns = zip(*(infos[place].values() for place in places), strict=True)
        for key, values in zip(keys, columns, strict=True):
            batch[key] = _added(batch.get(key), key, values, ours, num_envs)
            name = f"_{key}"
            if len(ours) == num_envs:
                batch[name] = np.ones(num_envs, np.bool_)
                continue
            if name not in batch:
                batch[name] = np.zeros(num_envs, np.bool_)
            batch[name][ours] = True


def _added(
    before: Any, key: str, values: tuple[Any, ...], numbers: list[int], num_envs: int
) -> NDArray[Any] | Batch:
    """What is under `key` once the values of the envs `numbers` are in it."""
    first = values[0]
    if isinstance(first, dict) and key != "final_obs":
        inner: Batch = {} if before is None else before
        _extend(inner, cast("_Infos", values), numbers, num_envs)
        return inner
    array = _empty(None if key == "final_obs" else first, num_envs) if before is None else before
    if array.dtype == np.object_:  # Numbers and arrays in it stay what they are.
        for number, value in zip(numbers, values, strict=True):
            array[number] = value
    elif len(numbers) == num_envs:
        array[:] = values
    else:
        array[numbers] = values
    return array


def _empty(value: Any, num_envs: int) -> NDArray[Any]:
    """An array for values such as this."""
    if _has_an_array(value):
        return np.zeros(num_envs, np.asarray(value).dtype)
    if isinstance(value, np.ndarray):
        array = cast("NDArray[Any]", value)
        return np.zeros((num_envs, *array.shape), array.dtype)
    return np.full(num_envs, None, np.object_)


def _has_an_array(value: object) -> bool:
    """Whether values of this type get an array of it; NumPy's booleans do not."""
    return type(value) in (int, float, bool) or isinstance(value, np.number)
