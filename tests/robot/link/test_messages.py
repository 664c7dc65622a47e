"""Messages of the link: round trips, bounds and invalid bytes."""

import contextlib
from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.errors import LinkError
from shapechanger.robot.link import messages
from shapechanger.robot.link.messages import decode_client_message, decode_robot_message, encode
from tests.robot.link.messages import client_messages, robot_messages

COMMAND = {"kind": "command", "seq": 1, "answers": 0, "values": [0]}
DECODERS = {"client": decode_client_message, "robot": decode_robot_message}


@given(asked=client_messages, answer=robot_messages)
def test_messages_round_trip(asked: messages.ClientMessage, answer: messages.RobotMessage) -> None:
    assert decode_client_message(encode(asked)) == asked
    assert decode_robot_message(encode(answer)) == answer


@pytest.mark.parametrize("side", DECODERS)
@given(data=st.binary(max_size=300) | client_messages.map(encode) | robot_messages.map(encode))
def test_any_bytes_are_a_message_or_refused(side: str, data: bytes) -> None:
    with contextlib.suppress(LinkError):
        again = encode(DECODERS[side](data))
        assert encode(DECODERS[side](again)) == again


@given(message=client_messages | robot_messages, data=st.data())
def test_a_damaged_message_is_refused_or_within_its_bounds(
    message: messages.ClientMessage | messages.RobotMessage, data: st.DataObject
) -> None:
    """A cut message is refused; one with a flipped bit may be another message."""
    whole = encode(message)
    cut = whole[: data.draw(st.integers(0, len(whole) - 1))]
    bit = data.draw(st.integers(0, 8 * len(whole) - 1))
    flipped = bytearray(whole)
    flipped[bit // 8] ^= 1 << bit % 8
    for decode in DECODERS.values():
        with pytest.raises(LinkError):
            decode(cut)
        with contextlib.suppress(LinkError):
            again = encode(decode(bytes(flipped)))
            assert encode(decode(again)) == again


def test_a_large_message_is_refused_before_it_is_read() -> None:
    with pytest.raises(LinkError, match="larger than the 65536 allowed"):
        decode_client_message(bytes(messages.MAX_CLIENT_MESSAGE + 1))
    with pytest.raises(LinkError, match="Not a valid message"):
        decode_client_message(bytes(messages.MAX_CLIENT_MESSAGE))


@pytest.mark.parametrize(
    "data",
    [
        b"\x82\xa4kind\xa7command\xa6values\xdd\xff\xff\xff\xff",
        b"\x82\xa4kind\xa5hello\xa5proof\xc6\xff\xff\xff\xff",
        b"\x82\xa4kind\xa5hello\xa4name\xdb\xff\xff\xff\xff",
        b"\xdf\xff\xff\xff\xff\xa4kind\xa4take",
        b"\x82\xa4kind\xa4take\xa1x" + b"\x91" * 60_000,
        b"\x82\xa4kind\xa4take\xa1x" + b"\x81\xa1x" * 20_000,
        encode(messages.Take()) + b"\x00",
    ],
)
def test_false_lengths_deep_nesting_and_trailing_bytes_are_refused(data: bytes) -> None:
    with pytest.raises(LinkError):
        decode_client_message(data)


@pytest.mark.parametrize(
    "fields",
    [
        *(COMMAND | {"seq": seq} for seq in (-1, 2**63, 1.5)),
        *(COMMAND | {"values": values} for values in (["0"], [0.0] * 65)),
        *(COMMAND | {"ttl_ms": ttl_ms} for ttl_ms in (0, 10**6)),
        *(COMMAND | {"scale": scale} for scale in (1.01, float("nan"))),
        {"kind": "hello", "version": 1, "proof": b"", "role": "king"},
        {"kind": "hello", "version": 1, "proof": b"", "name": "x" * 65},
        {"kind": "arm", "emergency": 0},  # `answers` is missing.
        {"kind": "observation", "seq": 1},
        {"kind": "dance"},
        {"seq": 1},
        [1, 2],
        None,
    ],
)
def test_values_out_of_bounds_are_refused(fields: object) -> None:
    with pytest.raises(LinkError, match="Not a valid message"):
        decode_client_message(msgspec.msgpack.encode(fields))


def test_unknown_keys_are_ignored_and_frames_are_bytes() -> None:
    fields = COMMAND | {"mood": {"is": ["good"]}}
    decoded = decode_client_message(msgspec.msgpack.encode(fields))
    assert decoded == messages.Command(seq=1, answers=0, values=(0.0,))
    jpeg = bytes(range(256)) * 20
    empty = dict.fromkeys(messages.Observation.__struct_fields__, 0) | {"kind": "observation"}
    sizes = [len(msgspec.msgpack.encode(empty | {"frame": one})) for one in (b"", jpeg)]
    assert sizes[1] - sizes[0] <= len(jpeg) + 4


def test_bytes_are_not_in_the_repr() -> None:
    fields = {name: 0 for name in messages.Observation.__struct_fields__}
    seen = messages.Observation(**(fields | {"frame": bytes(5_000), "holder": "Grace"}))
    assert "frame=<5000 bytes>" in repr(seen)
    assert "holder='Grace'" in repr(seen)
    assert len(repr(seen)) < 400
    assert "frame=None" in repr(msgspec.structs.replace(seen, frame=None))
    hello = messages.Hello(version=1, proof=b"secret" * 5)
    assert repr(hello).startswith("Hello(version=1, proof=<30 bytes>, name='', role='program'")


def test_the_page_has_the_version_and_the_size_of_messages() -> None:
    page = (Path(__file__).parents[3] / "docs" / "wire.md").read_text()
    assert f"`version` ({messages.VERSION})" in page
    assert f"| size of a client's message | {messages.MAX_CLIENT_MESSAGE // 1024} KiB |" in page
