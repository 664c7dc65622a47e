"""Threads share work: nothing is done twice, nothing is left."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from itertools import chain

from hypothesis import given
from hypothesis import strategies as st

from shapechanger.envs.vector.threads import Shares


@given(st.lists(st.integers(0, 7), min_size=1, max_size=4), st.data())
def test_each_item_is_taken_once_by_whoever_is_next(sizes: list[int], data: st.DataObject) -> None:
    """Own items from the front, those of others from the back, in any order of threads."""
    shares: Shares[tuple[int, int]] = Shares(len(sizes))
    taking: dict[int, Iterator[tuple[int, int]]] = {}
    for thread, size in enumerate(sizes):
        own = shares.own(thread, [(thread, i) for i in range(size)])
        taking[thread] = chain(own, shares.others(thread))
    taken: list[tuple[int, tuple[int, int]]] = []
    while taking:
        thread = data.draw(st.sampled_from(sorted(taking)))
        item = next(taking[thread], None)
        if item is None:
            del taking[thread]
        else:
            taken.append((thread, item))
    items = [item for _, item in taken]
    assert sorted(items) == [(t, i) for t, size in enumerate(sizes) for i in range(size)]
    for owner in range(len(sizes)):
        own = [i for thread, (of, i) in taken if of == owner == thread]
        helped = [i for thread, (of, i) in taken if of == owner != thread]
        assert own == sorted(own)
        assert helped == sorted(helped, reverse=True)


def test_threads_that_run_at_once_take_each_item_once() -> None:
    """Also when all of them reach for the last items together."""
    shares: Shares[int] = Shares(4)
    start = threading.Barrier(4)
    taken: list[list[int]] = [[] for _ in range(4)]

    def work(thread: int) -> None:
        start.wait()
        own = range(1000 * thread, 1000 * thread + (1000 if thread == 0 else 10))
        taken[thread] += chain(shares.own(thread, own), shares.others(thread))

    threads = [threading.Thread(target=work, args=(i,)) for i in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    expected = [*range(1000), *(1000 * t + i for t in (1, 2, 3) for i in range(10))]
    assert sorted(item for items in taken for item in items) == expected
