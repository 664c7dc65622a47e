"""Infos are batched as Gymnasium does it, whatever is in them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gymnasium.vector import VectorEnv
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.envs.vector.infos import batched
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
    "ends": [
        {"a": 1.0},
        {"final_obs": _VECTOR, "final_info": {"a": 2.0}, "a": 3.0},
        {"final_obs": _VECTOR + 1, "final_info": {"a": 2.0, "diverged": True}, "a": 3.0},
    ],
}


def _gymnasiums(infos: list[dict[str, Any]]) -> dict[str, Any]:
    envs: Any = VectorEnv()
    envs.num_envs = len(infos)
    batch: dict[str, Any] = {}
    for number, info in enumerate(infos):
        batch = envs._add_info(batch, info, number)
    return batch


@pytest.mark.parametrize("infos", _CASES.values(), ids=_CASES)
def test_odd_infos_are_batched_as_gymnasium_does(infos: list[dict[str, Any]]) -> None:
    """Keys and their order, types, masks."""
    require_same(batched(infos), _gymnasiums(infos))


_numbers = st.floats(allow_nan=False, width=32) | st.booleans() | st.integers(-1000, 1000)
_keys = st.sampled_from("abc")
_infos = st.dictionaries(_keys, _numbers.map(np.float64)) | st.fixed_dictionaries(
    {"final_info": st.dictionaries(_keys, _numbers.map(np.float64)), "final_obs": st.just(_VECTOR)}
)


@given(st.lists(_infos, min_size=1, max_size=6))
def test_any_infos_are_batched_as_gymnasium_does(infos: list[dict[str, Any]]) -> None:
    """Any mixture of keys."""
    require_same(batched(infos), _gymnasiums(infos))
