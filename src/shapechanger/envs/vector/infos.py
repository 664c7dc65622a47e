"""The infos of many envs as one dictionary of arrays, with a mask for each."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

__all__ = ["Columns", "batched", "in_columns"]

# For each key one entry per env, and under the key with a `_` before it whether the env has one.
Batch = dict[str, Any]


class Columns(NamedTuple):
    """The infos of envs that have the same keys.

    Attributes:
        numbers: The numbers of the envs, from the lowest up.
        values: For each key one value per env.
    """

    numbers: Sequence[int]
    values: Mapping[str, Sequence[Any] | NDArray[Any]]

    def only(self, places: Sequence[int]) -> Columns:
        """The infos of the envs at these places."""
        if len(places) == len(self.numbers):
            return self
        return Columns(
            [self.numbers[place] for place in places],
            {key: [column[place] for place in places] for key, column in self.values.items()},
        )

    def rows(self) -> list[dict[str, Any]]:
        """The info of each env."""
        return [
            dict(zip(self.values, row, strict=True))
            for row in zip(*self.values.values(), strict=True)
        ]


def in_columns(numbers: Sequence[int], infos: Sequence[Mapping[str, Any]]) -> list[Columns]:
    """The infos of the envs `numbers`, with those together that have the same keys."""
    groups: dict[tuple[str, ...], list[int]] = {}
    for place, info in enumerate(infos):
        groups.setdefault(tuple(info), []).append(place)
    return [
        Columns(
            [numbers[place] for place in places],
            dict(zip(keys, zip(*(infos[i].values() for i in places), strict=True), strict=True)),
        )
        for keys, places in groups.items()
    ]


def batched(parts: Iterable[Columns], num_envs: int) -> Batch:
    """The infos of all envs, as Gymnasium's vector envs give them.

    Gymnasium adds one env after another and each key by itself. Envs whose infos have the same keys
    are added together here, for a tenth of the time.

    Args:
        parts: The infos of the envs that have any.
        num_envs: How many envs there are.
    """
    batch: Batch = {}
    _extend(batch, parts, num_envs)
    return batch


def _extend(batch: Batch, parts: Iterable[Columns], num_envs: int) -> None:
    """Add infos to arrays for `num_envs`, those of the lowest env first, as its types count."""
    for numbers, values in sorted(parts, key=lambda part: part.numbers[0]):
        where = slice(None) if len(numbers) == num_envs else np.asarray(numbers)
        masks = np.zeros((len(values), num_envs), np.bool_)
        masks[:, where] = True
        for (key, column), mask in zip(values.items(), masks, strict=True):
            batch[key] = _added(batch.get(key), key, column, numbers, where, num_envs)
            name = f"_{key}"
            batch[name] = batch[name] | mask if name in batch else mask


def _added(
    before: Any,
    key: str,
    values: Sequence[Any] | NDArray[Any],
    numbers: Sequence[int],
    where: slice | NDArray[np.intp],
    num_envs: int,
) -> NDArray[Any] | Batch:
    """What is under `key` once the values of the envs `numbers`, which are `where`, are in it."""
    first = values[0]
    if isinstance(first, dict) and key != "final_obs":
        inner: Batch = {} if before is None else before
        _extend(inner, in_columns(numbers, cast("Sequence[Any]", values)), num_envs)
        return inner
    if before is None and isinstance(values, np.ndarray) and values.size == num_envs:
        return np.array(values)
    if before is not None:
        array = before
    elif isinstance(values, np.ndarray):
        array = np.zeros(num_envs, values.dtype)
    else:
        array = _empty(None if key == "final_obs" else first, num_envs)
    if array.dtype == np.object_:  # Numbers and arrays in it stay what they are.
        for number, value in zip(numbers, values, strict=True):
            array[number] = value
    else:
        array[where] = values
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
