"""Messages of a twin's board to a client that does not read."""

from __future__ import annotations

import socket
from collections.abc import Iterator

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shapechanger.robot.drivers.simulation import Edge
from shapechanger.robot.twin.rpc import (
    MAX_MESSAGE,
    BoardConnection,
    Event,
    Grant,
    InputEdges,
    Reply,
    decode_event,
)

pytestmark = pytest.mark.realtime  # It opens sockets.


def received(client: socket.socket, board: BoardConnection) -> Iterator[Event]:
    """Yield all messages that wait, while the board sends more."""
    client.setblocking(False)
    while True:
        try:
            yield decode_event(client.recv(MAX_MESSAGE))
        except BlockingIOError:
            return
        board.flush()


@settings(max_examples=25)
@given(kinds=st.lists(st.sampled_from(["edge", "edges", "reply", "grant"]), max_size=40))
def test_only_edges_are_dropped(kinds: list[str]) -> None:
    """All replies and grants arrive in order, and of each input at least the last edge."""
    own, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    board = BoardConnection(own)
    sent: list[Event] = []
    edges: list[Edge] = []
    t = 0
    with theirs:
        for kind in [*["edge"] * 400, *kinds, *["reply"] * 300, *kinds]:
            t += 1
            match kind:
                case "reply":
                    sent.append(Reply(t, msgspec.Raw(b"\x01")))
                    board.send(sent[-1])
                case "grant":
                    sent.append(Grant(t))
                    board.send(sent[-1])
                case _:
                    pins = (4, 5) if kind == "edges" else (4 + t % 2,)
                    new = [Edge(t, pin, t % 2) for pin in pins]
                    board.send_edges(new)
                    edges += new
        events = list(received(theirs, board))
        own.close()
    assert [event for event in events if not isinstance(event, InputEdges)] == sent
    got = [edge for event in events if isinstance(event, InputEdges) for edge in event.edges]
    assert got == sorted(got)
    assert set(got) <= set(edges)
    for pin in (4, 5):
        assert [e for e in got if e.pin == pin][-1] == [e for e in edges if e.pin == pin][-1]


def test_merged_edges_do_not_pile_up() -> None:
    """However long a client does not read, edges occupy a bounded outbox."""
    own, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    board = BoardConnection(own)
    with theirs:
        for t in range(2000):
            board.send_edges([Edge(t, 4 + t % 2, t % 2)])
        assert len(list(received(theirs, board))) < 1000
        own.close()
