"""Encoding and strict decoding of the messages between daemon and guard."""

import json
from dataclasses import asdict, replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.robot.guard.messages import (
    MAX_DATAGRAM,
    GuardState,
    Order,
    decode_order,
    decode_state,
    encode,
)

_ORDER = Order("command", 1, 2, 3, 4, 5, (0.5, -1.0), 6, "why", True)
_STATE = GuardState(
    1, True, False, 2, "", (0.5,), 3, 4, 5, "", None, {"drive": 0.5}, {"speed": 1.0}, {}, 0
)


def test_orders_and_states_round_trip() -> None:
    assert decode_order(encode(_ORDER)) == _ORDER
    assert decode_state(encode(_STATE)) == _STATE


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("kind", "dance"),
        ("kind", ["command"]),
        ("session", 1.0),
        ("seq", True),
        ("issued_ns", None),
        ("ttl_ms", "1"),
        ("emergency", []),
        ("frame_ns", 1.5),
        ("values", 3),
        ("values", ["0"]),
        ("values", [True]),
        ("values", [float("nan")]),
        ("values", [float("inf")]),
        ("values", [10**400]),
        ("reason", 5),
        ("person", 1),
        ("other", 1),
    ],
)
def test_an_invalid_order_is_refused(field: str, value: object) -> None:
    data = json.dumps(asdict(_ORDER) | {field: value}).encode()
    with pytest.raises(ValueError, match=r"^Invalid order: "):
        decode_order(data)


def test_a_state_with_long_reasons_fits_into_a_datagram() -> None:
    words = "\N{GRINNING FACE}" * 250
    state = replace(_STATE, stop_reason=words, refused=words + "\ud800")
    assert len(encode(state)) < MAX_DATAGRAM // 4
    assert decode_state(encode(state)).refused == words + "?"


@pytest.mark.parametrize("data", [b"", b"\xff", b"[]", b"1", b"[" * 16_000, b"{}", b"\x00"])
def test_anything_but_a_json_object_is_refused(data: bytes) -> None:
    for decode in (decode_order, decode_state):
        with pytest.raises(ValueError, match=r"."):
            decode(data)


@given(st.binary(max_size=200))
def test_decoding_bytes_gives_an_order_or_a_value_error(data: bytes) -> None:
    try:
        assert isinstance(decode_order(data), Order)
    except ValueError:
        return


@given(
    st.dictionaries(
        st.sampled_from([*asdict(_ORDER), "x"]),
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
