"""Edges at a twin's board for a client that does not wait for them."""

import socket

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shapechanger.robot.drivers.simulation import Edge
from shapechanger.robot.twin.rpc import MAX_MESSAGE, Awake, BoardConnection, Reply

pytestmark = pytest.mark.realtime  # It opens sockets.


@settings(max_examples=25)
@given(pins=st.lists(st.integers(4, 6), max_size=2000))
def test_the_last_edge_of_each_input_is_kept(pins: list[int]) -> None:
    """Few edges all arrive; of more than a message holds, at least the last of each input."""
    own, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    edges = [Edge(t, pin, t % 2) for t, pin in enumerate(pins)]
    with own, theirs:
        board = BoardConnection(own)
        for edge in edges:
            board.add_edge(edge)
        board.waits = 7
        board.wake(9, always=True)
        board.wake(10, always=True)  # It no longer waits.
        reply = msgspec.msgpack.decode(theirs.recv(MAX_MESSAGE), type=Reply)
        assert reply.id == 7
        awake: Awake = reply.decode(Awake)
    got = awake.edges
    assert got == sorted(set(edges) & set(got))
    assert got == edges or len(edges) > 500
    assert {edge.pin: edge for edge in got} == {edge.pin: edge for edge in edges}
