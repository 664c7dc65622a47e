"""The connection from the daemon to the guard."""

import asyncio
import socket
from collections.abc import Iterator

import pytest

from shapechanger.robot.daemon.process import GuardLink
from shapechanger.robot.guard.channel import MAX_DATAGRAM, GuardState, Order, decode_order, encode
from tests.robot.daemon.plans import guard_state
from tests.robot.daemon.running import until


class Ends:
    """Both ends of the connection, and the calls of its two callbacks."""

    def __init__(self) -> None:
        self.guard, daemon = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.guard.setblocking(False)
        self.states: list[GuardState] = []
        self.lost: list[bool] = []
        self.port = GuardLink(daemon.detach(), self.states.append, lambda: self.lost.append(True))

    def received(self) -> list[Order]:
        """Return all orders that the guard can read now."""
        orders: list[Order] = []
        while True:
            try:
                orders.append(decode_order(self.guard.recv(MAX_DATAGRAM)))
            except BlockingIOError:
                return orders


@pytest.fixture
def ends(runner: asyncio.Runner) -> Iterator[Ends]:
    async def connect() -> Ends:
        return Ends()

    ends = runner.run(connect())
    yield ends
    ends.port.close()
    ends.guard.close()


async def test_states_arrive_in_order_and_invalid_ones_are_skipped(
    ends: Ends, caplog: pytest.LogCaptureFixture
) -> None:
    ends.guard.send(encode(guard_state(at_ns=1)))
    ends.guard.send(b"nonsense")
    ends.port.drain()
    assert [state.at_ns for state in ends.states] == [1]
    ends.guard.send(b'{"at_ns": "3"}')
    ends.guard.send(encode(guard_state(at_ns=4)))
    await until(lambda: [state.at_ns for state in ends.states] == [1, 4], "the states arrive")
    assert [text.partition(" is not a state: ")[0] for text in caplog.messages] == [
        "A message of the guard"
    ] * 2
    assert "malformed" in caplog.messages[0]
    assert "at_ns" in caplog.messages[1]


@pytest.mark.parametrize("left", ["nothing", "an order", "stops that wait"])
@pytest.mark.parametrize("reads_first", [True, False])
async def test_a_lost_guard_is_reported_once(
    ends: Ends, caplog: pytest.LogCaptureFixture, reads_first: bool, left: str
) -> None:
    for _ in range({"nothing": 0, "an order": 1}.get(left, 5_000)):
        ends.port.send(Order(kind="disarm"))
        ends.port.send(Order(kind="halt"))
    caplog.clear()
    ends.guard.close()
    if left == "stops that wait":
        await until(lambda: ends.lost, "the loss is reported")
    for _ in range(2):
        if reads_first:
            ends.port.drain()
        ends.port.send(Order(kind="disarm"))
        ends.port.drain()
    assert (ends.lost, caplog.messages) == ([True], [])


async def test_a_full_socket_keeps_the_first_stops_and_drops_commands(
    ends: Ends, caplog: pytest.LogCaptureFixture
) -> None:
    """A repeat does not replace a waiting stop, and nothing overtakes one."""

    def command(count: int) -> None:
        for seq in range(count):
            ends.port.send(Order(kind="command", seq=seq, values=(0.1,)))

    command(5_000)
    before = [order.seq for order in ends.received()]
    assert before == list(range(len(before)))
    assert len(before) < 5_000
    command(5_000)
    stops = ("disarm", "emergency", "halt")
    for reason in ("first", "second", "third"):
        for kind in (*stops, "arm"):
            ends.port.send(Order(kind=kind, reason=reason))
    received = [decode_order(ends.guard.recv(MAX_DATAGRAM))]
    ends.port.send(Order(kind="arm"))  # There is room, but stops wait for it.

    def stopped() -> bool:
        received.extend(ends.received())
        return received[-3:] == [Order(kind=kind, reason="first") for kind in stops]

    await until(stopped, "the first stop of each kind has arrived, in order")
    assert {order.kind for order in received[:-3]} == {"command"}
    assert received[-4].seq < 4_999
    # Once for each time that the guard did not read.
    said = "The guard does not read: commands are dropped, and stops wait."
    assert caplog.messages == [said, said]
