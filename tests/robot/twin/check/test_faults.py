"""The bad network between driver and robot adds exactly the faults that were set."""

from __future__ import annotations

import contextlib
import random
import socket
import time
from collections.abc import Iterator

import pytest

from shapechanger.robot.twin.check.faults import BadNetwork

pytestmark = pytest.mark.realtime

PATIENCE_S = 10.0


def takes(sink: socket.socket, size: int) -> bytes:
    """Receive up to `size` bytes."""
    got = b""
    while len(got) < size and (more := sink.recv(size - len(got))):
        got += more
    return got


class Line:
    """A connection through the network, from `near` to `far`."""

    def __init__(self, network: BadNetwork, listener: socket.socket) -> None:
        self.network = network
        self.near = socket.create_connection(("127.0.0.1", network.port), PATIENCE_S)
        self.far, _ = listener.accept()
        self.far.settimeout(PATIENCE_S)

    def carries(self, data: bytes, *, back: bool = False) -> bytes:
        """Send bytes and return those received at the other end."""
        source, sink = (self.far, self.near) if back else (self.near, self.far)
        source.sendall(data)
        return takes(sink, len(data))

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


@pytest.mark.parametrize("back", [False, True])
def test_slicing_keeps_the_data(line: Line, back: bool) -> None:
    """Slicing keeps content and order in both directions."""
    line.network.slice_bytes = 1
    generator = random.Random(int(back))
    for _ in range(40):
        data = generator.randbytes(generator.randint(1, 3000))
        assert line.carries(data, back=back) == data


def test_large_writes_arrive_whole(line: Line) -> None:
    """Data beyond the network's buffers arrives whole."""
    data = random.Random(0).randbytes(300_000)
    line.near.sendall(data[:100_000])
    assert line.carries(data[100_000:])[:100_000] == data[:100_000]
    assert takes(line.far, 100_000) == data[200_000:]


def test_latency(line: Line) -> None:
    """Bytes are held until the latency has passed, and no longer."""
    assert line.carries(b"prompt") == b"prompt"
    line.network.latency_s = 0.2
    began_s = time.monotonic()
    line.near.sendall(b"late")
    assert takes(line.far, 4) == b"late"
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
    assert takes(line.far, 4) == b"held"


def test_reset_closes_both_ends(line: Line) -> None:
    assert line.carries(b"before") == b"before"
    line.network.reset()
    for end in (line.near, line.far):
        with contextlib.suppress(ConnectionResetError):
            assert end.recv(1) == b""


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
        assert near.recv(1) == b""
