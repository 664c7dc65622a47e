"""Batching of infos as in Gymnasium."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.envs.vector.results import InfoColumns, StepResults, batched, in_columns
from tests.envs.vector.sameness import require_same

_VECTOR = np.arange(3.0)


def _many(count: int) -> Any:
    envs: Any = VectorEnv()
    envs.num_envs = count
    return envs


def _ours(infos: list[dict[str, Any]]) -> dict[str, Any]:
    return batched(_many(len(infos)), in_columns(dict(enumerate(infos))))


def _gymnasiums(infos: list[dict[str, Any]]) -> dict[str, Any]:
    envs, batch = _many(len(infos)), {}
    for number, info in enumerate(infos):
        batch = envs._add_info(batch, info, number)
    return batch


# The first env that has a key decides the type of the key's array.
_values: Any = st.fixed_dictionaries(
    {},
    optional={
        "a": st.sampled_from([1.5, 2.7]) | st.floats(allow_nan=False, width=32).map(np.float64),
        "b": st.integers(-1000, 1000) | st.booleans() | st.just(2.7),
        "c": st.sampled_from([np.float32(1), np.int8(3)]),
        "d": st.sampled_from([_VECTOR, _VECTOR + 1]),
        "e": st.sampled_from(["x", "yy", None, (1, 2), np.bool_(1)]),
    },
)
_infos = (
    _values
    | st.fixed_dictionaries({"final_info": _values, "final_obs": st.just(_VECTOR), "b": st.just(1)})
    | st.fixed_dictionaries({"f": st.fixed_dictionaries({"g": _values, "a": st.just(1.0)})})
)


@given(st.lists(_infos, min_size=1, max_size=6))
def test_any_infos_are_batched_as_in_gymnasium(infos: list[dict[str, Any]]) -> None:
    """Random mixtures of keys give equal keys, order of keys, types and masks."""
    require_same(_ours(infos), _gymnasiums(infos))


@given(st.lists(st.sampled_from([0, 1, 2]), min_size=1, max_size=8), st.randoms())
def test_columns_are_batched_alike(kinds: list[int], order: Any) -> None:
    """Columns of several threads and single infos, in any order, give equal batches."""
    infos = [{"a": np.float64(i), "b": i} if part else {"b": 0.5} for i, part in enumerate(kinds)]
    parts: list[InfoColumns] = []
    for part in (1, 2):
        numbers = [i for i, each in enumerate(kinds) if each == part]
        if numbers:
            values = {"a": np.array(numbers, np.float64), "b": np.array(numbers)}
            parts.append(InfoColumns(numbers, values))
    parts += in_columns({i: infos[i] for i, each in enumerate(kinds) if each == 0})
    order.shuffle(parts)
    require_same(batched(_many(len(infos)), parts), _gymnasiums(infos))


def test_infos_with_the_same_keys_are_grouped() -> None:
    first, second = in_columns({0: {"a": 1}, 1: {"b": 2}, 2: {"a": 3}})
    assert (first.numbers, second.numbers) == ([0, 2], [1])
    assert first.values == {"a": [1, 3]}
    tuples = [{"a": (1, 2)}] * 3
    require_same(_ours(tuples), _gymnasiums(tuples))


def test_columns_are_split_by_env() -> None:
    """A single result replaces the columns' info of its env."""
    results = StepResults(2)
    ends = np.zeros(2, np.bool_)
    results.put_columns([0, 1], np.zeros(2), ends, ends, {"a": np.array([1.0, 2.0])})
    assert results.of_each()[1] == {"a": 2.0}
    results.put(0, (0.5, True, False, {"diverged": True}))
    assert results.of_each() == [{"diverged": True}, {"a": 2.0}]
