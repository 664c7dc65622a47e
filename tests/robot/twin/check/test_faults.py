"""The bad network between driver and robot adds exactly the faults that were set."""

from __future__ import annotations

import contextlib
import random
import socket
import time
from collections.abc import Iterator

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shapechanger.robot.twin.check.faults import BadNetwork
from tests.robot.twin.robots import until

pytestmark = pytest.mark.realtime

PATIENCE_S = 10.0


class Line:
    """A connection through the network.

    Attributes:
        network: The network.
        near: Socket of the connecting side.
        far: Socket of the accepting side.
    """

    def __init__(self, network: BadNetwork, listener: socket.socket) -> None:
        self.network = network
        self.near = socket.create_connection(("127.0.0.1", network.port), PATIENCE_S)
        self.far, _ = listener.accept()
        self.far.settimeout(PATIENCE_S)

    def carries(self, data: bytes, *, back: bool = False) -> bytes:
        """Send bytes and return those received at the other end."""
        source, sink = (self.far, self.near) if back else (self.near, self.far)
        source.sendall(data)
        return self.takes(sink, len(data))

    def takes(self, sink: socket.socket, size: int) -> bytes:
        """Receive up to `size` bytes."""
        got = b""
        while len(got) < size and (more := sink.recv(size - len(got))):
            got += more
        return got

    def close(self) -> None:
        """Close both ends."""
        self.near.close()
        self.far.close()


@pytest.fixture(scope="module")
def far() -> Iterator[socket.socket]:
    """A listening socket."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.settimeout(PATIENCE_S)
        yield listener


@pytest.fixture
def line(far: socket.socket) -> Iterator[Line]:
    """A connection through a network without faults."""
    with contextlib.closing(BadNetwork(far.getsockname()[1])) as network:
        made = Line(network, far)
        yield made
        made.close()


@pytest.fixture(scope="module")
def sliced(far: socket.socket) -> Iterator[Line]:
    """A connection through a network that forwards one byte at a time."""
    with contextlib.closing(BadNetwork(far.getsockname()[1])) as network:
        network.slice_bytes = 1
        made = Line(network, far)
        yield made
        made.close()


@given(data=st.binary(min_size=1, max_size=3000), back=st.booleans())
@settings(max_examples=40)
def test_slicing_keeps_the_data(sliced: Line, data: bytes, back: bool) -> None:
    """Slicing keeps content and order in both directions."""
    assert sliced.carries(data, back=back) == data


def test_large_writes_arrive_whole(line: Line) -> None:
    """Data beyond the network's buffers arrives whole."""
    data = random.Random(0).randbytes(300_000)
    line.near.sendall(data[:100_000])
    assert line.carries(data[100_000:])[:100_000] == data[:100_000]
    assert line.takes(line.far, 100_000) == data[200_000:]


def test_latency(line: Line) -> None:
    """Bytes are held until the latency has passed, and no longer."""
    assert line.carries(b"prompt") == b"prompt"
    line.network.latency_s = 0.2
    began_s = time.monotonic()
    line.near.sendall(b"late")
    assert line.takes(line.far, 4) == b"late"
    assert 0.2 <= time.monotonic() - began_s < PATIENCE_S


def test_silence_holds_data_and_keeps_the_connection(line: Line) -> None:
    """While silent, the network holds data; afterwards it delivers everything."""
    assert line.carries(b"before") == b"before"
    line.network.silent = True
    line.near.sendall(b"held")
    line.far.settimeout(0.2)
    with pytest.raises(TimeoutError):
        line.far.recv(1)
    line.far.settimeout(PATIENCE_S)
    line.network.silent = False
    assert line.takes(line.far, 4) == b"held"


def test_reset_closes_both_ends(line: Line) -> None:
    assert line.carries(b"before") == b"before"
    line.network.reset()

    def ended(end: socket.socket) -> bool:
        try:
            return end.recv(1) == b""
        except ConnectionResetError:
            return True

    assert ended(line.near)
    assert ended(line.far)


def test_half_close(line: Line) -> None:
    """After a half close, the far end reads an end of file and can still send."""
    assert line.carries(b"before") == b"before"
    line.network.half_close()
    assert line.far.recv(1) == b""
    assert line.carries(b"after", back=True) == b"after"


def test_a_connection_without_a_listener_closes() -> None:
    """A connection closes at once when nothing listens behind the network."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    with (
        contextlib.closing(BadNetwork(port)) as network,
        socket.create_connection(("127.0.0.1", network.port), PATIENCE_S) as near,
    ):
        ends: list[bytes] = []

        def ended() -> bool:
            ends.append(near.recv(1))
            return ends[-1] == b""

        until(ended)
