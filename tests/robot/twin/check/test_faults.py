"""The bad network between driver and robot adds exactly the faults that were set."""

import contextlib
import random
import socket
import time
from collections.abc import Iterator
from typing import NamedTuple

import pytest

from shapechanger.robot.twin.check.faults import BadNetwork

pytestmark = pytest.mark.realtime

PATIENCE_S = 10.0


class Line(NamedTuple):
    """A connection through a network without faults yet, from `near` to `far`."""

    network: BadNetwork
    near: socket.socket
    far: socket.socket


@pytest.fixture
def line() -> Iterator[Line]:
    with contextlib.ExitStack() as opened:
        listener = opened.enter_context(socket.create_server(("127.0.0.1", 0)))
        network = opened.enter_context(contextlib.closing(BadNetwork(listener.getsockname()[1])))
        address = ("127.0.0.1", network.port)
        near = opened.enter_context(socket.create_connection(address, PATIENCE_S))
        listener.settimeout(PATIENCE_S)
        far = opened.enter_context(listener.accept()[0])
        far.settimeout(PATIENCE_S)
        yield Line(network, near, far)


def carried(source: socket.socket, sink: socket.socket, data: bytes) -> bytes:
    """Send bytes and return those that arrive."""
    source.sendall(data)
    got = b""
    while len(got) < len(data) and (more := sink.recv(len(data) - len(got))):
        got += more
    return got


@pytest.mark.parametrize(("slice_bytes", "largest"), [(1, 3000), (65536, 200_000)])
def test_content_and_order_are_kept(line: Line, slice_bytes: int, largest: int) -> None:
    """In both directions, in slices, and beyond the network's buffers."""
    line.network.slice_bytes = slice_bytes
    generator = random.Random(slice_bytes)
    for way in [line[1:], line[:0:-1]] * 20:
        data = generator.randbytes(generator.randint(1, largest))
        assert carried(*way, data) == data


def test_latency(line: Line) -> None:
    line.network.latency_s = 0.2
    began_s = time.monotonic()
    assert carried(line.near, line.far, b"late") == b"late"
    assert 0.2 <= time.monotonic() - began_s < PATIENCE_S


def test_silence_holds_data_and_keeps_the_connection(line: Line) -> None:
    line.network.silent = True
    line.far.settimeout(0.2)
    with pytest.raises(TimeoutError):
        carried(line.near, line.far, b"held")
    line.far.settimeout(PATIENCE_S)
    line.network.silent = False
    assert line.far.recv(4) == b"held"


def test_reset_closes_both_ends(line: Line) -> None:
    assert carried(line.near, line.far, b"before") == b"before"
    line.network.reset()
    for end in (line.near, line.far):
        with pytest.raises(ConnectionResetError):
            end.recv(1)


def test_half_close(line: Line) -> None:
    """After a half close, the far end reads an end of file and can still send, whatever comes."""
    assert carried(line.near, line.far, b"before") == b"before"
    line.network.half_close()
    assert line.far.recv(1) == b""
    for _ in range(5):
        line.near.sendall(b"lost")
        assert carried(line.far, line.near, b"after") == b"after"
