"""Batching of infos as in Gymnasium."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gymnasium.vector import VectorEnv
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.envs.vector.results import InfoColumns, StepResults, batched, in_columns
from tests.envs.vector.sameness import require_same

_VECTOR = np.arange(3.0)

_CASES: dict[str, list[dict[str, Any]]] = {
    "nothing": [{}, {}],
    "numbers": [{"a": 1.5, "b": 2, "c": True}, {"a": 2.5, "b": 3, "c": False}],
    "types of numpy": [{"a": np.float32(1), "b": np.int8(3), "c": np.bool_(1)}] * 2,
    "one has more": [{"a": 1.0}, {"b": 2.0, "a": 3.0}, {"a": 4.0}],
    "the first type counts": [{"a": 1}, {"a": 2.7}, {"a": True}],
    "arrays": [{"a": _VECTOR}, {"a": _VECTOR + 1}, {}],
    "words": [{"a": "x", "b": None}, {"a": "yy", "b": (1, 2)}],
    "in one another": [{"a": {"b": 1.0, "c": {"d": 2}}}, {}, {"a": {"c": {"d": 3}, "e": "x"}}],
    "another order within": [
        {"final_info": {}, "final_obs": _VECTOR},
        {"final_obs": _VECTOR, "final_info": {"a": 0.0}},
        {"final_info": {"b": 0.0}, "final_obs": _VECTOR},
    ],
    "ends": [
        {"a": 1.0},
        {"final_obs": _VECTOR, "final_info": {"a": 2.0}, "a": 3.0},
        {"final_obs": _VECTOR + 1, "final_info": {"a": 2.0, "diverged": True}, "a": 3.0},
    ],
}


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


@pytest.mark.parametrize("infos", _CASES.values(), ids=_CASES)
def test_special_infos_are_batched_as_in_gymnasium(infos: list[dict[str, Any]]) -> None:
    """Keys, their order, types and masks are equal."""
    require_same(_ours(infos), _gymnasiums(infos))


_numbers = st.floats(allow_nan=False, width=32) | st.booleans() | st.integers(-1000, 1000)
_keys = st.sampled_from("abc")
_infos = st.dictionaries(_keys, _numbers.map(np.float64)) | st.fixed_dictionaries(
    {"final_info": st.dictionaries(_keys, _numbers.map(np.float64)), "final_obs": st.just(_VECTOR)}
)


@given(st.lists(_infos, min_size=1, max_size=6))
def test_any_infos_are_batched_as_in_gymnasium(infos: list[dict[str, Any]]) -> None:
    """Random mixtures of keys give equal batches."""
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


def test_columns_are_split_by_env() -> None:
    """A single result replaces the columns' info of its env."""
    results = StepResults(2)
    infos = InfoColumns([0, 1], {"a": np.array([1.0, 2.0])})
    results.put_columns(infos, np.zeros(2), np.zeros(2, np.bool_), [False, False])
    assert results.of_each()[1] == {"a": 2.0}
    results.put(0, (0.5, True, False, {"diverged": True}))
    assert results.of_each() == [{"diverged": True}, {"a": 2.0}]
