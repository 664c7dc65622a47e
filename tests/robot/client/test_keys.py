"""Keys that hold the robot's steering and throttle."""

import os
import pty
import sys

import pytest

from shapechanger.robot.client.teleop import (
    DIRECTIONS,
    FIRST_HOLD_S,
    REPEAT_HOLD_S,
    HeldKeys,
    KeyParser,
    NoTerminal,
    Terminal,
)


@pytest.mark.parametrize(("key", "meaning"), DIRECTIONS.items())
def test_direction_keys_move_their_action(key: str, meaning: tuple[str, float]) -> None:
    keys = HeldKeys()
    assert keys.press(key, 0.0)
    action, value = meaning
    other = "steering" if action == "throttle" else "throttle"
    assert (keys.value(action, 0.0), keys.value(other, 0.0)) == (value, 0.0)


def test_a_press_expires() -> None:
    keys = HeldKeys()
    keys.press("w", 10.0)
    assert keys.value("throttle", 10.0 + FIRST_HOLD_S) == 1.0
    assert keys.value("throttle", 10.0 + FIRST_HOLD_S + 1e-6) == 0.0


def test_a_held_key_ends_after_its_last_repeat() -> None:
    keys = HeldKeys()
    for n in range(20):
        keys.press("up", n * 0.03 + (0.5 if n else 0.0))
    last = 19 * 0.03 + 0.5
    assert keys.value("throttle", last + 0.9 * REPEAT_HOLD_S) == 1.0
    assert keys.value("throttle", last + 1.1 * REPEAT_HOLD_S) == 0.0


def test_the_opposite_key_takes_over_at_once() -> None:
    keys = HeldKeys()
    keys.press("w", 0.0)
    keys.press("s", 0.1)
    assert keys.value("throttle", 0.1) == -1.0


def test_other_keys_are_ignored() -> None:
    keys = HeldKeys()
    assert not keys.press("x", 0.0)
    keys.press("a", 0.0)
    keys.let_go()
    assert keys.value("steering", 0.0) == 0.0


def test_arrow_keys_have_two_encodings() -> None:
    assert KeyParser().feed(b"\x1b[A\x1bOBq\x1b[C\x1b[D", 0.0) == [
        "up",
        "down",
        "q",
        "right",
        "left",
    ]


def test_driving_needs_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    with open(os.devnull) as nothing:
        monkeypatch.setattr(sys, "stdin", nothing)
        with pytest.raises(NoTerminal, match="needs a terminal"):
            Terminal()


def test_the_terminal_is_unbuffered_and_restored(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    import termios

    ours, theirs = pty.openpty()
    with os.fdopen(theirs) as stdin:
        monkeypatch.setattr(sys, "stdin", stdin)
        before = termios.tcgetattr(theirs)
        with Terminal() as terminal:
            assert terminal.keys(0.0) == []
            os.write(ours, b"w\x1b[A")
            assert terminal.keys(5.0) == ["w", "up"]
        assert termios.tcgetattr(theirs) == before
    os.close(ours)


def test_a_held_key_continues_when_another_is_pressed() -> None:
    keys = HeldKeys()
    for n in range(30):
        keys.press("w", 0.03 * n)
    last = 0.03 * 29
    keys.press("a", last + 0.02)
    assert keys.value("steering", last + 0.1) == -1.0
    assert keys.value("throttle", last + FIRST_HOLD_S) == 1.0


def test_another_key_does_not_extend_a_hold() -> None:
    keys = HeldKeys()
    for n in range(30):
        keys.press("w", 0.03 * n)
    last = 0.03 * 29
    for n in range(60):
        keys.press("a", last + 0.02 + 0.03 * n)
    assert keys.value("throttle", last + FIRST_HOLD_S + 1e-6) == 0.0


def test_another_key_does_not_revive_an_expired_one() -> None:
    keys = HeldKeys()
    keys.press("w", 0.0)
    keys.press("w", 0.5)
    assert keys.value("throttle", 0.5 + 1.1 * REPEAT_HOLD_S) == 0.0
    keys.press("a", 0.5 + 1.2 * REPEAT_HOLD_S)
    assert keys.value("throttle", 0.5 + 1.2 * REPEAT_HOLD_S) == 0.0
