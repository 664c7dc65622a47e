"""The guard's end of the daemon socket, its heartbeat, and strict decoding of its messages."""

from __future__ import annotations

import contextlib
import json
import os
import socket
from collections.abc import Iterator
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.robot.guard.channel import (
    MAX_DATAGRAM,
    NO_STATE,
    DaemonChannel,
    GuardState,
    Heartbeat,
    Order,
    decode_order,
    decode_state,
    encode,
)

Ends = tuple[DaemonChannel, socket.socket]


@pytest.fixture
def ends() -> Iterator[Ends]:
    """The guard's channel and the daemon's socket."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    channel = DaemonChannel(ours.detach())
    yield channel, theirs
    channel.close()
    theirs.close()


def test_a_malformed_datagram_is_reported_and_the_next_order_arrives(ends: Ends) -> None:
    channel, daemon = ends
    for data in (b"{", b"x" * (MAX_DATAGRAM + 1), encode(Order(kind="halt"))):
        daemon.send(data)
    orders, malformed = channel.orders()
    assert orders == [Order(kind="halt")]
    assert [text[:13] for text in malformed] == ["Invalid order", "A datagram is"]


def test_a_state_for_a_closed_socket_means_a_lost_daemon(ends: Ends) -> None:
    channel, daemon = ends
    daemon.close()
    assert not channel.send(NO_STATE)
    assert channel.lost is True


@pytest.mark.parametrize("unread", [False, True])
def test_a_closed_socket_means_a_lost_daemon(ends: Ends, unread: bool) -> None:
    """If the daemon left states unread, the kernel resets the connection; this is no order."""
    channel, daemon = ends
    if unread:
        while channel.send(NO_STATE):  # As many as fit.
            pass
        assert decode_state(daemon.recv(MAX_DATAGRAM)) == NO_STATE
    else:
        daemon.send(encode(Order(kind="halt")))
    assert not channel.lost
    daemon.close()
    orders = [] if unread else [Order(kind="halt")]
    assert channel.orders() == (orders, [])
    assert channel.lost
    assert not channel.send(NO_STATE)


def test_a_closed_life_pipe_means_a_lost_daemon(ends: Ends) -> None:
    """Only the first pipe counts, and further ones are closed."""
    channel, daemon = ends
    (watched, held), (more, other) = os.pipe(), os.pipe()
    for fd in (watched, more):
        socket.send_fds(daemon, [b"life"], [fd])
        os.close(fd)
    (third, last) = os.pipe()
    socket.send_fds(daemon, [b"two"], [third, third])
    os.close(third)
    assert channel.orders() == ([], [])
    for unwatched in (other, last):
        with pytest.raises(BrokenPipeError):
            os.write(unwatched, b"x")
        os.close(unwatched)
    assert channel.orders() == ([], [])
    assert not channel.lost
    assert len(channel.filenos()) == 2
    os.close(held)
    channel.orders()
    assert channel.lost


def test_a_heart_beats_once_a_period_until_the_supervisor_is_gone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    ours, supervisor = socket.socketpair(socket.AF_UNIX, socket.SOCK_STREAM)
    with supervisor, socket.socket(fileno=ours.detach()) as kept:
        heart = Heartbeat(kept.fileno(), period_s=2.0)
        assert heart.lost is False
        assert not os.get_inheritable(heart.fileno())
        beats: dict[int, bytes] = {}
        supervisor.setblocking(False)
        for at_ns in (2_000_000_000, 3_999_999_999, 4_000_000_000, 4_000_000_001):
            monkeypatch.setattr("time.monotonic_ns", lambda at_ns=at_ns: at_ns)
            heart.beat()
            with contextlib.suppress(BlockingIOError):
                beats[at_ns] = supervisor.recv(8)
        assert beats == {2_000_000_000: b".", 4_000_000_000: b"."}
        supervisor.close()
        heart.beat()
        assert heart.lost
        assert heart.leave() == kept.detach()


_ORDER = Order("command", 1, 2, 3, 4, 5, (0.5, -1.0), 6, "why", True)
_STATE = GuardState(
    1, True, False, 2, "", (0.5,), 3, 4, 5, "", None, {"drive": 0.5}, {"speed": 1.0}, {}, 0
)


def test_orders_and_whole_states_round_trip() -> None:
    assert decode_order(encode(_ORDER)) == _ORDER
    assert decode_state(encode(_STATE)) == _STATE
    fields = msgspec.structs.asdict(_STATE)
    for missing in fields:
        rest = {name: value for name, value in fields.items() if name != missing}
        with pytest.raises(ValueError, match=f"missing required field `{missing}`"):
            decode_state(json.dumps(rest).encode())


@pytest.mark.parametrize(
    ("field", "values"),
    [
        ("kind", ["dance", ["command"]]),
        *((name, [1.5, True, None, "1", []]) for name in ("session", "seq", "issued_ns", "ttl_ms")),
        ("frame_ns", [1.5]),
        ("values", [3, [True], ["1"], [float("nan")], [float("inf")], [10**400]]),
        ("emergency", [[]]),
        ("reason", [5]),
        ("person", [1]),
        ("other", [1]),
    ],
)
def test_an_invalid_order_is_refused(field: str, values: list[object]) -> None:
    for value in values:
        data = json.dumps(msgspec.structs.asdict(_ORDER) | {field: value}).encode()
        with pytest.raises(ValueError, match=rf"{field}|JSON is malformed"):
            decode_order(data)


@pytest.mark.parametrize("data", [b"", b"\xff", b"1", b"[" * 16_000, b"{}"])
def test_anything_but_an_order_is_refused(data: bytes) -> None:
    with pytest.raises(ValueError, match=r"truncated|malformed|Expected `object`|missing"):
        decode_order(data)


_json = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner),
    max_leaves=5,
)


@given(
    data=st.binary(max_size=200)
    | st.dictionaries(st.sampled_from([*Order.__struct_fields__, "x"]), _json)
)
def test_decoding_gives_an_order_of_finite_values_or_a_value_error(data: Any) -> None:
    if not isinstance(data, bytes):
        data = json.dumps({"kind": "command"} | data).encode()
    with contextlib.suppress(ValueError):
        assert all(abs(value) < float("inf") for value in decode_order(data).values)
