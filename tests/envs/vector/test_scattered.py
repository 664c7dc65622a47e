"""Numbers that lie anywhere are read as if they had been put side by side."""

from __future__ import annotations

import gc
import weakref
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import shapechanger
from shapechanger.envs.vector.alike import Alike
from shapechanger.envs.vector.scattered import Scattered
from tests.envs.vector.sameness import require_same

_SIZES = st.lists(st.integers(0, 5), min_size=1, max_size=4).filter(any)


@given(_SIZES, st.integers(1, 5), st.integers(0, 2**32 - 1))
def test_what_is_read_is_what_the_arrays_hold_now(sizes: list[int], rows: int, seed: int) -> None:
    """To the last bit, in their order, parts of larger arrays and whole numbers among them."""
    rng = np.random.default_rng(seed)
    large = rng.normal(size=(rows, 40))
    arrays: list[list[Any]] = []
    for row in large:
        starts = rng.integers(0, 35, len(sizes))
        arrays.append([row[i : i + size] for i, size in zip(starts, sizes, strict=True)])
        arrays[-1][0] = rng.integers(-(2**62), 2**62, sizes[0])
    order = rng.permutation(rows)
    scattered = Scattered([arrays[i] for i in order])
    for _ in range(2):
        large += 1.0
        expected = [b"".join(array.tobytes() for array in arrays[i]) for i in order]
        assert [row.tobytes() for row in scattered.read()] == expected


@given(st.integers(1, 4), st.integers(1, 6), st.data(), st.integers(0, 2**32 - 1))
def test_what_is_written_lands_there_and_nowhere_else(
    width: int, rows: int, data: st.DataObject, seed: int
) -> None:
    """In the chosen rows, as an assignment to each array would put it there."""
    chosen = data.draw(st.none() | st.lists(st.integers(0, rows - 1), unique=True))
    rng = np.random.default_rng(seed)
    memory = rng.normal(size=(rows, 10))
    expected = memory.copy()
    starts = rng.integers(0, 10 - width, rows)
    arrays = [memory[i, start : start + width] for i, start in enumerate(starts)]
    where = range(rows) if chosen is None else chosen
    values = rng.normal(size=(len(where), width)).astype(rng.choice([np.float32, np.float64]))
    for value, i in zip(values, where, strict=True):
        expected[i, starts[i] : starts[i] + width] = value
    numbers = None if chosen is None else np.array(chosen, np.intp)
    scattered = Scattered([[array] for array in arrays])
    scattered.write(values, numbers)
    assert memory.tobytes() == expected.tobytes()
    assert scattered.read(numbers).tobytes() == values.astype(np.float64).tobytes()


def test_the_memory_that_is_read_is_kept() -> None:
    """Even when nobody else knows the arrays any more."""
    scattered = Scattered([[np.full(1000, 1.0)], [np.full(1000, 2.0)]])
    gc.collect()
    others = [np.full(1000, 3.0) for _ in range(50)]
    assert scattered.read().sum() == 3000.0
    del others


@pytest.mark.parametrize("threads", [1, 2])
def test_an_env_with_another_body_is_read_where_it_lies_now(threads: int) -> None:
    """And what lay elsewhere before is given back."""
    ours = shapechanger.make_vec("Ant", 4, threads=threads)
    theirs = shapechanger.make_vec("Ant", 4, threads=1)
    theirs_alone: Any = theirs
    rng = np.random.default_rng(0)
    for envs in (ours, theirs):
        envs.reset(seed=0)
    left = weakref.ref(ours.envs[1].unwrapped.data)
    for body in ("BigAnt", "AmputatedAnt"):
        for _ in range(3):
            actions = rng.uniform(-1.0, 1.0, (4, 8)).astype(np.float32)
            theirs_alone._alike = [Alike()]  # It remembers nothing.
            require_same(ours.step(actions), theirs.step(actions))
        mask = np.array([False, True, False, True])
        options = {"body": body, "reset_mask": mask}
        require_same(ours.reset(options=options), theirs.reset(options=options))
    ours.step(actions)
    theirs.close()
    gc.collect()
    assert left() is None
    ours.close()
