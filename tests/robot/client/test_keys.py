"""Keys that hold the robot's steering and throttle, escape sequences, and the terminal."""

import itertools
import os
import sys
import termios

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.robot.client.teleop import (
    DIRECTIONS,
    ESCAPE_WAIT_S,
    FIRST_HOLD_S,
    OTHER,
    REPEAT_HOLD_S,
    REST_WAIT_S,
    STOPS,
    HeldKeys,
    KeyParser,
    NoTerminal,
    Terminal,
)

ARROWS = {b"\x1b[A": "up", b"\x1bOB": "down", b"\x1b[C": "right", b"\x1bOD": "left"}


UNKNOWN = (
    # Keys with Ctrl, Shift and Alt, of xterm, rxvt, the Linux console and PuTTY.
    *(b"\x1b[1;%d%c" % (mods, key) for mods in range(2, 9) for key in b"ABCDEFHPQRS"),
    *(b"\x1b%c" % key for key in b"abcdefghijklmnopqrstuvwxyzADEPRMUX+-=\r\t\x7f"),
    *(b"\x1bO%c" % key for key in b"abcdEFHIMPQRSjklmnopqrstuvwxyX"),
    *(b"\x1bO5%c" % key for key in b"ABCDPQRS"),
    *(b"\x1b[%c" % key for key in b"abcdEFHIOPQSZ"),
    *(b"\x1b[[%c" % key for key in b"ABCDE"),
    *(b"\x1b[%d~" % key for key in range(1, 35)),
    *(b"\x1b[%d;5~" % key for key in range(1, 35)),
    *(b"\x1b[%d^" % key for key in range(2, 9)),
    # kitty's protocol and xterm's modifyOtherKeys: W, A, S, D, E and P, pressed and released.
    *(b"\x1b[%du" % key for key in b"wasdep"),
    *(b"\x1b[%d;1:3u" % key for key in b"wasdep \x1b"),
    *(b"\x1b[27;5;%d~" % key for key in b"wasdep"),
    # Mouse, focus, and replies to requests of another program.
    b"\x1b[<0;12;34M",
    b"\x1b[M#we",
    b"\x1b[M`\xc3\xa9e",
    b"\x1b[twe",
    b"\x1b[Twasdep",
    b"\x1b[I",
    b"\x1b[O",
    b"\x1b[>41;354;0c",
    b"\x1b]11;rgb:dddd/eeee/aaaa\x07",
    b"\x1b]11;rgb:dddd/eeee/aaaa\x1b\\",
    b"\x1b]52;c;d2FzZGVw\x1b\\",
    b"\x1bP>|xterm(385)\x07wasdep\x1b\\",
    b"\x1b_Gi=31;wasdep\x1b\\",
    b"\x1b^wasdep\x1b\\",
    b"\x1bXwasdep\x1b\\",
    b"\x1b(w",
    b"\x1b(A",
    # Controls of eight bits, raw and as UTF-8.
    b"\x9b1;5D",
    b"\x9b[A",
    b"\x8fP",
    b"\x9d11;wasdep\x9c",
    b"\x90wasdep\xc2\x9c",
    b"\xc2\x9b1;5D",
    b"\xc2\x9d0;wasdep\x07",
    # Characters, control characters and other encodings: e with an accent, the Cyrillic letter on
    # the key W, an emoji, and "e" as the second byte of a character in Shift JIS and GBK.
    "\N{LATIN SMALL LETTER E WITH ACUTE}".encode(),
    "\N{CYRILLIC SMALL LETTER TSE}".encode(),
    "\N{AUTOMOBILE}".encode(),
    b"\x83e",
    b"\xc4e",
    *(bytes([code]) for code in range(1, 27) if code not in b"\r\n"),
    # Pasted text.
    b"\x1b[200~wasd\rep\x1b[201~",
)


W_FOR_1_S = [("w", 0.033 * n) for n in range(31)]
LAST_S = W_FOR_1_S[-1][1]
A_FOR_2_S = [("a", LAST_S + 0.03 * n) for n in range(1, 60)]
EXPIRED_S = 0.5 + 1.2 * REPEAT_HOLD_S
JUST = 1e-6


@pytest.mark.parametrize(("key", "meaning"), DIRECTIONS.items())
def test_direction_keys_move_their_action(key: str, meaning: tuple[str, float]) -> None:
    keys = HeldKeys()
    assert keys.press(key, 0.0)
    action, value = meaning
    other = "steering" if action == "throttle" else "throttle"
    assert (keys.value(action, 0.0), keys.value(other, 0.0)) == (value, 0.0)


@pytest.mark.parametrize(
    ("presses", "now_s", "throttle", "steering"),
    [
        # A press expires.
        ([("w", 10.0)], 10.0 + FIRST_HOLD_S, 1.0, 0.0),
        ([("w", 10.0)], 10.0 + FIRST_HOLD_S + JUST, 0.0, 0.0),
        # A held key ends after its last repeat, and an early repeat does not shorten a press.
        (W_FOR_1_S, LAST_S + 0.9 * REPEAT_HOLD_S, 1.0, 0.0),
        (W_FOR_1_S, LAST_S + 1.1 * REPEAT_HOLD_S, 0.0, 0.0),
        ([("w", 0.0), ("w", 0.03)], FIRST_HOLD_S, 1.0, 0.0),
        # The opposite key takes over at once.
        ([("w", 0.0), ("s", 0.1)], 0.1, -1.0, 0.0),
        # When another key is pressed, a held key continues for FIRST_HOLD_S after its last repeat.
        ([*W_FOR_1_S, ("a", LAST_S + 0.02)], LAST_S + FIRST_HOLD_S, 1.0, -1.0),
        ([*W_FOR_1_S, *A_FOR_2_S], LAST_S + FIRST_HOLD_S + JUST, 0.0, -1.0),
        # Another key does not revive an expired one.
        ([("w", 0.0), ("w", 0.5), ("a", EXPIRED_S)], EXPIRED_S, 0.0, -1.0),
    ],
)
def test_a_press_is_held_for_its_hold_time(
    presses: list[tuple[str, float]], now_s: float, throttle: float, steering: float
) -> None:
    keys = HeldKeys()
    for key, pressed_s in presses:
        keys.press(key, pressed_s)
    assert (keys.value("throttle", now_s), keys.value("steering", now_s)) == (throttle, steering)
    keys.let_go()
    assert (keys.value("throttle", now_s), keys.value("steering", now_s)) == (0.0, 0.0)


def test_driving_needs_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    with open(os.devnull) as null:
        monkeypatch.setattr(sys, "stdin", null)
        with pytest.raises(NoTerminal, match="needs a terminal"):
            Terminal()


def test_the_terminal_is_unbuffered_and_restored(typed: tuple[int, Terminal]) -> None:
    keyboard, terminal = typed
    inside = termios.tcgetattr(sys.stdin)
    terminal.__exit__()
    before = termios.tcgetattr(sys.stdin)
    assert before[3] & termios.ECHO
    assert not inside[3] & (termios.ECHO | termios.ICANON)
    with terminal:
        assert terminal.keys(0.0) == []
        os.write(keyboard, b"w\x1b[A")
        assert terminal.keys(5.0) == ["w", "up"]
    assert termios.tcgetattr(sys.stdin) == before


@pytest.mark.parametrize(("sequence", "key"), ARROWS.items())
def test_an_arrow_is_one_key_unless_a_pause_follows_its_escape(sequence: bytes, key: str) -> None:
    for place in range(1, len(sequence)):
        for gap_s in (0.0, 0.9 * ESCAPE_WAIT_S, 0.9 * REST_WAIT_S):
            keys = pieces((sequence[:place], sequence[place:]), gap_s)
            late = place == 1 and gap_s > ESCAPE_WAIT_S
            assert keys == (["escape"] if late else [key])


@pytest.mark.parametrize("sequence", UNKNOWN, ids=repr)
def test_an_unknown_sequence_gives_at_most_a_stop_however_it_is_split(sequence: bytes) -> None:
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
def test_a_read_of_three_different_keys_moves_no_action(
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


def test_a_held_escape_stops_within_a_tenth_of_a_second() -> None:
    parser, now_s = KeyParser(), 0.0
    while "escape" not in parser.feed(b"\x1b", now_s):
        now_s += 0.033
    assert now_s <= 2 * ESCAPE_WAIT_S
