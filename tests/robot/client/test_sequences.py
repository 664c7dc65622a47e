"""Escape sequences of terminals: parsed whole, and never letters."""

import itertools
import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.robot.client.teleop import (
    DIRECTIONS,
    ESCAPE_WAIT_S,
    OTHER,
    REST_WAIT_S,
    STOPS,
    KeyParser,
    Terminal,
)
from tests.robot.client.sequences import ARROWS, UNKNOWN


@pytest.mark.parametrize(("sequence", "key"), ARROWS.items())
def test_an_arrow_is_one_key_however_it_is_split(sequence: bytes, key: str) -> None:
    for place in range(1, len(sequence)):
        for gap_s in (0.0, 0.9 * ESCAPE_WAIT_S, 0.9 * REST_WAIT_S):
            keys = pieces((sequence[:place], sequence[place:]), gap_s)
            late = place == 1 and gap_s > ESCAPE_WAIT_S
            assert keys == (["escape"] if late else [key])


@pytest.mark.parametrize("sequence", UNKNOWN, ids=repr)
def test_an_unknown_sequence_is_no_key_however_it_is_split(sequence: bytes) -> None:
    """Nor does any part of one move a robot or type anything."""
    assert set(pieces([sequence], 0.0)) == {OTHER}
    splits = [(sequence[:place], sequence[place:]) for place in range(1, len(sequence))]
    for parts in (*splits, [bytes([byte]) for byte in sequence]):
        for gap_s in (0.9 * ESCAPE_WAIT_S, 0.9 * REST_WAIT_S):
            assert set(pieces(parts, gap_s)) <= {*STOPS, OTHER} - set(DIRECTIONS)


@given(
    st.lists(
        st.tuples(
            st.sampled_from(UNKNOWN) | st.sampled_from([*ARROWS, b" ", b"\x1b"]),
            st.integers(1, 20),  # Bytes until the next read.
            st.floats(0.0, 0.99 * REST_WAIT_S),
        ),
        max_size=12,
    )
)
def test_sequences_in_any_order_give_no_letter(parts: list[tuple[bytes, int, float]]) -> None:
    parser, now_s, keys = KeyParser(), 0.0, list[str]()
    for sequence, size, gap_s in parts:
        for start in range(0, len(sequence), size):
            keys += parser.feed(sequence[start : start + size], now_s)
            now_s += gap_s
    keys += parser.expire(now_s + REST_WAIT_S)
    assert set(keys) <= {*ARROWS.values(), *STOPS, OTHER}


@given(st.binary(max_size=40), st.lists(st.integers(0, 40), max_size=3))
def test_space_and_escape_always_stop(noise: bytes, splits: list[int]) -> None:
    ends = sorted({0, *splits, len(noise)})
    for stop, data in (("space", b" "), ("escape", b"\x1b")):
        parser = KeyParser()
        for start, end in itertools.pairwise(ends):
            parser.feed(noise[start:end], 0.0)
        assert (parser.feed(data, 0.01) + parser.expire(0.01 + ESCAPE_WAIT_S)).count(stop) == 1
    assert parser.feed(b"w", 0.01 + ESCAPE_WAIT_S + REST_WAIT_S) == ["w"]


@given(st.sampled_from(UNKNOWN), st.integers(0, 40))
def test_keys_work_again_after_a_part_of_a_sequence(sequence: bytes, size: int) -> None:
    part = sequence[:size]
    if part.startswith(b"\x1b[200~") or "\ufffd" in part.decode(errors="replace"):
        return
    parser = KeyParser()
    parser.feed(part, 0.0)
    assert parser.feed(b"W", REST_WAIT_S + 0.1)[-1] == "w"


@pytest.mark.parametrize(
    ("sequence", "key"),
    [
        (b"\x1b", "escape"),
        (b"\x1b\x1b", "escape"),
        (b"\x1b\x1b[A", "escape"),  # Alt+Up of rxvt, or Escape and Up.
        (b"\x1b[27u", "escape"),
        (b"\x1b[27;129u", "escape"),
        (b"\x1b[27;5;27~", "escape"),
        (b"\x1b[32;5u", "space"),
        (b"\x1b[27;5;32~", "space"),
        (b"\x1b ", "space"),
        (b"\x00", "space"),
        (b"\x1bO ", "space"),
        (b"\x1b[200~w e\x1b[201~", "space"),
    ],
    ids=repr,
)
def test_a_stop_has_many_encodings(sequence: bytes, key: str) -> None:
    keys = pieces([sequence], 0.0)
    assert key in keys
    assert set(keys) <= {key, OTHER}


@pytest.mark.parametrize(
    ("data", "keys"),
    [
        (b"go west", ["space"]),
        (b"e e", ["space"]),
        (b"west", [OTHER]),
        (b"we", ["w", "e"]),
        (b"wwwa\r", ["w", "w", "w", "a", "enter"]),
    ],
)
def test_a_read_with_many_keys_is_no_typing(
    typed: tuple[int, Terminal], data: bytes, keys: list[str]
) -> None:
    keyboard, terminal = typed
    os.write(keyboard, data)
    assert terminal.keys(5.0) == keys


def pieces(parts: list[bytes] | tuple[bytes, ...], gap_s: float) -> list[str]:
    """Return the keys of reads with pauses between them."""
    parser = KeyParser()
    keys = [key for n, part in enumerate(parts) for key in parser.feed(part, n * gap_s)]
    return keys + parser.expire(len(parts) * gap_s + REST_WAIT_S)


def test_a_held_escape_stops_at_once() -> None:
    parser, now_s = KeyParser(), 0.0
    while "escape" not in parser.feed(b"\x1b", now_s):
        now_s += 0.033
    assert now_s <= 2 * ESCAPE_WAIT_S
