"""The guard's end of the daemon socket, and strict decoding of its messages."""

from __future__ import annotations

import contextlib
import json
import os
import re
import socket
from collections.abc import Iterator

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


@pytest.fixture
def ends() -> Iterator[tuple[DaemonChannel, socket.socket]]:
    """The guard's channel and the daemon's socket."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    channel = DaemonChannel(ours.detach())
    yield channel, theirs
    channel.close()
    theirs.close()


def test_a_malformed_datagram_is_reported_and_the_next_order_arrives(
    ends: tuple[DaemonChannel, socket.socket],
) -> None:
    channel, daemon = ends
    for data in (b"{", b"x" * (MAX_DATAGRAM + 1), encode(Order(kind="halt"))):
        daemon.send(data)
    orders, malformed = channel.orders()
    assert orders == [Order(kind="halt")]
    assert [text.partition(":")[0] for text in malformed] == [
        "Invalid order",
        f"A datagram is larger than {MAX_DATAGRAM} bytes.",
    ]


def test_a_closed_socket_means_a_lost_daemon(ends: tuple[DaemonChannel, socket.socket]) -> None:
    channel, daemon = ends
    daemon.send(encode(Order(kind="halt")))
    daemon.close()
    assert [order.kind for order in channel.orders()[0]] == ["halt"]
    assert channel.lost


def test_a_daemon_that_leaves_states_unread_is_lost(
    ends: tuple[DaemonChannel, socket.socket],
) -> None:
    """The connection is reset, which is no order."""
    channel, daemon = ends
    channel.send(NO_STATE)
    daemon.close()
    assert channel.orders() == ([], [])
    assert channel.lost


def test_a_closed_life_pipe_means_a_lost_daemon(ends: tuple[DaemonChannel, socket.socket]) -> None:
    channel, daemon = ends
    watched, held = os.pipe()
    assert len(channel.filenos()) == 1
    socket.send_fds(daemon, [b"life"], [watched])
    os.close(watched)
    assert channel.orders() == ([], [])
    assert not channel.lost
    assert len(channel.filenos()) == 2
    os.close(held)
    assert channel.orders() == ([], [])
    assert channel.lost


def test_data_in_a_life_pipe_do_not_wait_for_writing(
    ends: tuple[DaemonChannel, socket.socket],
) -> None:
    """A lifeline that could be written to is no dead daemon."""
    channel, daemon = ends
    ours, theirs = socket.socketpair()
    with theirs:
        socket.send_fds(daemon, [b"life"], [ours.detach()])
        channel.orders()
        channel.orders()
        assert not channel.lost


def test_a_state_fits_or_not_and_a_lost_daemon_is_noticed(
    ends: tuple[DaemonChannel, socket.socket],
) -> None:
    channel, daemon = ends
    assert channel.send(NO_STATE)
    assert decode_state(daemon.recv(MAX_DATAGRAM)) == NO_STATE
    while channel.send(NO_STATE):
        pass
    assert not channel.lost
    daemon.close()
    assert not channel.send(NO_STATE)
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


def test_a_second_life_pipe_is_closed(ends: tuple[DaemonChannel, socket.socket]) -> None:
    channel, daemon = ends
    pipes = [os.pipe() for _ in range(2)]
    for watched, _ in pipes:
        socket.send_fds(daemon, [b"life"], [watched])
        os.close(watched)
    assert channel.orders() == ([], [])
    with pytest.raises(BrokenPipeError):
        os.write(pipes[1][1], b"x")
    os.write(pipes[0][1], b"x")  # The first pipe is still open.
    for _, held in pipes:
        os.close(held)


_ORDER = Order("command", 1, 2, 3, 4, 5, (0.5, -1.0), 6, "why", True)
_STATE = GuardState(
    1, True, False, 2, "", (0.5,), 3, 4, 5, "", None, {"drive": 0.5}, {"speed": 1.0}, {}, 0
)


def test_orders_and_states_round_trip() -> None:
    assert decode_order(encode(_ORDER)) == _ORDER
    assert decode_state(encode(_STATE)) == _STATE


def _expected(kind: str, got: str, at: str) -> str:
    return f"Expected `{kind}`, got `{got}` - at `$.{at}`"


@pytest.mark.parametrize(
    ("field", "value", "text"),
    [
        ("kind", "dance", "Invalid enum value 'dance' - at `$.kind`"),
        ("kind", ["command"], _expected("str", "array", "kind")),
        ("session", 1.0, _expected("int", "float", "session")),
        ("seq", True, _expected("int", "bool", "seq")),
        ("issued_ns", None, _expected("int", "null", "issued_ns")),
        ("ttl_ms", "1", _expected("int", "str", "ttl_ms")),
        ("frame_ns", 1.5, _expected("int | null", "float", "frame_ns")),
        ("values", 3, _expected("array", "int", "values")),
        ("values", [True], _expected("float", "bool", "values[0]")),
        ("values", [float("nan")], "JSON is malformed: invalid character"),
        ("values", [float("inf")], "JSON is malformed: invalid character"),
        ("values", [10**400], "Number out of range - at `$.values[0]`"),
        ("emergency", [], _expected("int", "array", "emergency")),
        ("reason", 5, _expected("str", "int", "reason")),
        ("person", 1, _expected("bool", "int", "person")),
        ("other", 1, "Object contains unknown field `other`"),
    ],
)
def test_an_invalid_order_is_refused(field: str, value: object, text: str) -> None:
    data = json.dumps(msgspec.structs.asdict(_ORDER) | {field: value}).encode()
    with pytest.raises(ValueError, match=rf"^{re.escape(text)}"):
        decode_order(data)


@pytest.mark.parametrize(
    ("data", "text"),
    [
        (b"", "Input data was truncated"),
        (b"\xff", "JSON is malformed: invalid character (byte 0)"),
        (b"1", "Expected `object`, got `int`"),
        (b"[" * 16_000, "Expected `object`, got `array`"),
        (b"{}", "Object missing required field `kind`"),
    ],
)
def test_anything_but_an_order_is_refused(data: bytes, text: str) -> None:
    with pytest.raises(ValueError, match=rf"^{re.escape(text)}"):
        decode_order(data)


@pytest.mark.parametrize("field", GuardState.__struct_fields__)
def test_a_state_without_a_field_is_refused(field: str) -> None:
    fields = msgspec.structs.asdict(_STATE)
    del fields[field]
    with pytest.raises(ValueError, match=f"missing required field `{field}`"):
        decode_state(json.dumps(fields).encode())


def test_a_state_with_long_reasons_fits_into_a_datagram() -> None:
    text = "\N{GRINNING FACE}" * 250
    state = msgspec.structs.replace(_STATE, stop_reason=text, refused=text)
    assert len(encode(state)) < MAX_DATAGRAM // 4


@given(st.binary(max_size=200))
def test_decoding_bytes_gives_an_order_or_a_value_error(data: bytes) -> None:
    try:
        assert isinstance(decode_order(data), Order)
    except ValueError:
        return


@given(
    st.dictionaries(
        st.sampled_from([*msgspec.structs.asdict(_ORDER), "x"]),
        st.recursive(
            st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
            lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner),
            max_leaves=5,
        ),
    )
)
def test_decoding_objects_gives_an_order_or_a_value_error(fields: dict[str, object]) -> None:
    try:
        order = decode_order(json.dumps({"kind": "command"} | fields).encode())
    except ValueError:
        return
    assert all(abs(value) < float("inf") for value in order.values)
