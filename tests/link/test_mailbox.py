"""The mailbox with one slot, which can never replay."""

from __future__ import annotations

import threading

from hypothesis import given
from hypothesis import strategies as st

from shapechanger.robot.daemon.camera import Latest

_moves = st.lists(st.one_of(st.just("put"), st.just("take"), st.just("clear")), max_size=60)


@given(moves=_moves)
def test_only_the_newest_comes_out_and_only_once(moves: list[str]) -> None:
    """Whatever the order of moves: the last thing put, or nothing; what comes out only rises."""
    box: Latest[int] = Latest()
    waiting: int | None = None
    taken: list[int] = []
    for number, move in enumerate(moves):
        if move == "put":
            box.put(number)
            waiting = number
        elif move == "clear":
            box.clear()
            waiting = None
        else:
            got = box.take()
            assert got == waiting
            waiting = None
            if got is not None:
                taken.append(got)
        assert bool(box) == (waiting is not None)
    assert taken == sorted(set(taken))


def test_two_threads_never_see_a_thing_twice() -> None:
    """One puts and one takes: numbers rise, and the last one is not lost."""
    box: Latest[int] = Latest()
    last = 20_000

    def put() -> None:
        for number in range(last + 1):
            box.put(number)

    writer = threading.Thread(target=put)
    writer.start()
    taken: list[int] = []
    while not taken or taken[-1] != last:
        got = box.take()
        if got is not None:
            taken.append(got)
    writer.join()
    assert taken == sorted(set(taken))
