"""Requests to a board that replies late, and edges for a client that does not wait for them."""

import contextlib
import itertools
import socket
import threading
from pathlib import Path

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.simulation import Edge
from shapechanger.robot.twin import rpc
from shapechanger.robot.twin.hardware import GrantedClock, SteadyClock

pytestmark = pytest.mark.realtime  # The tests open sockets.


def _reply(number: int, result: object) -> bytes:
    return rpc.encode(rpc.Reply(number, msgspec.Raw(rpc.encode(result))))


def _connected(folder: Path) -> tuple[rpc.BoardClient, socket.socket]:
    """Return a client, and the board's end of its connection, which is not read."""
    listening = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    path = str(folder / "board.socket")
    listening.bind(path)
    listening.listen()
    ends: list[socket.socket] = []

    def greet() -> None:
        end, _ = listening.accept()
        end.recv(rpc.MAX_MESSAGE)
        end.send(_reply(1, rpc.Greeting(clock="real", t=0)))
        ends.append(end)

    with listening:
        board = threading.Thread(target=greet)
        board.start()
        client = rpc.BoardClient(path, "hardware")
        board.join()
    return client, ends[0]


@pytest.mark.parametrize("clock", ["steady", "granted"])
def test_heartbeats_are_sent_while_a_reply_is_late(tmp_path: Path, clock: str) -> None:
    """The board replies after five heartbeats of the guard."""
    client, board = _connected(tmp_path)
    beats = itertools.count(1)

    def beat() -> None:
        if next(beats) == 5:
            board.send(_reply(2, 7))

    made = SteadyClock(client) if clock == "steady" else GrantedClock(client, "")
    made.keep_alive(beat)
    with board:
        assert client.ask(int, "levels") == 7
        client.close()
    assert next(beats) >= 6


def test_a_request_waits_while_the_socket_is_full(tmp_path: Path) -> None:
    client, board = _connected(tmp_path)
    beats: list[int] = []

    def beat() -> None:
        beats.append(1)
        if len(beats) == 3:
            with contextlib.suppress(BlockingIOError):
                while True:
                    board.recv(rpc.MAX_MESSAGE, socket.MSG_DONTWAIT)

    client.while_held_up = beat
    with board:
        while not beats:
            client.post("levels")
        client.close()
    assert len(beats) == 3


def test_a_board_that_never_replies_ends_the_heartbeats(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After the time limit, no heartbeat is sent, so that the supervisor detects the silence."""
    monkeypatch.setattr(rpc, "_PATIENCE_S", 0.0)
    client, board = _connected(tmp_path)
    client.while_held_up = lambda: pytest.fail("a beat for a broken board")
    ending = threading.Timer(0.05, board.close)
    ending.start()
    with pytest.raises(RobotError, match="board has ended"):
        client.ask(int, "levels")
    ending.join()
    client.close()


@settings(max_examples=25)
@given(pins=st.lists(st.integers(4, 6), max_size=2000))
def test_the_last_edge_of_each_input_is_kept(pins: list[int]) -> None:
    """Up to 500 edges all arrive; of more edges, at least the last edge of each input arrives."""
    own, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    edges = [Edge(t, pin, t % 2) for t, pin in enumerate(pins)]
    with own, theirs:
        board = rpc.BoardConnection(own)
        for edge in edges:
            board.add_edge(edge)
        board.waits = 7
        board.wake(9, always=True)
        board.wake(10, always=True)  # No effect, because the client no longer waits.
        reply = msgspec.msgpack.decode(theirs.recv(rpc.MAX_MESSAGE), type=rpc.Reply)
        assert reply.id == 7
        awake: rpc.Awake = reply.decode(rpc.Awake)
    got = awake.edges
    assert got == sorted(set(edges) & set(got))
    assert got == edges or len(edges) > 500
    assert {edge.pin: edge for edge in got} == {edge.pin: edge for edge in edges}
