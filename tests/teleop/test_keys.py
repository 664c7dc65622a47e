"""Keys that hold the robot's steering and throttle."""

import os
import pty
import sys

import pytest

from shapechanger.teleop import (
    DIRECTIONS,
    FIRST_HOLD_S,
    REPEAT_HOLD_S,
    HeldKeys,
    NoTerminal,
    Terminal,
    keys_in,
)


@pytest.mark.parametrize(("key", "meaning"), DIRECTIONS.items())
def test_each_direction_moves_its_action(key: str, meaning: tuple[str, float]) -> None:
    """W is forward, A is left, and the arrows mean the same."""
    keys = HeldKeys()
    assert keys.press(key, 0.0)
    action, value = meaning
    other = "steering" if action == "throttle" else "throttle"
    assert (keys.value(action, 0.0), keys.value(other, 0.0)) == (value, 0.0)


def test_a_press_ends_by_itself() -> None:
    """A terminal that dies with a key down must not leave the robot running."""
    keys = HeldKeys()
    keys.press("w", 10.0)
    assert keys.value("throttle", 10.0 + FIRST_HOLD_S) == 1.0
    assert keys.value("throttle", 10.0 + FIRST_HOLD_S + 1e-6) == 0.0


def test_a_held_key_lasts_until_shortly_after_its_last_repeat() -> None:
    """The hold is long only until the terminal begins to repeat."""
    keys = HeldKeys()
    for n in range(20):
        keys.press("up", n * 0.03 + (0.5 if n else 0.0))
    last = 19 * 0.03 + 0.5
    assert keys.value("throttle", last + 0.9 * REPEAT_HOLD_S) == 1.0
    assert keys.value("throttle", last + 1.1 * REPEAT_HOLD_S) == 0.0


def test_the_opposite_key_takes_over_at_once() -> None:
    """S replaces a W that is still held."""
    keys = HeldKeys()
    keys.press("w", 0.0)
    keys.press("s", 0.1)
    assert keys.value("throttle", 0.1) == -1.0


def test_other_keys_move_nothing_and_letting_go_releases_all() -> None:
    """Only direction keys count."""
    keys = HeldKeys()
    assert not keys.press("x", 0.0)
    keys.press("a", 0.0)
    keys.let_go()
    assert keys.value("steering", 0.0) == 0.0


def test_terminals_spell_arrows_in_two_ways() -> None:
    """The same arrow is sent differently in application mode."""
    assert keys_in("\x1b[A\x1bOBq\x1b[C\x1b[D") == ["up", "down", "q", "right", "left"]


def test_driving_needs_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    """The standard input may be a pipe."""
    with open(os.devnull) as nothing:
        monkeypatch.setattr(sys, "stdin", nothing)
        with pytest.raises(NoTerminal, match="needs a terminal"):
            Terminal()


def test_keys_arrive_without_enter_and_the_terminal_is_restored(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Line editing and echo are off only within the block."""
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


def test_a_held_key_goes_on_a_little_when_another_one_is_pressed() -> None:
    """A terminal stops repeating W as soon as A goes down, though both are held."""
    keys = HeldKeys()
    for n in range(30):
        keys.press("w", 0.03 * n)
    last = 0.03 * 29
    keys.press("a", last + 0.02)
    assert keys.value("steering", last + 0.1) == -1.0
    assert keys.value("throttle", last + FIRST_HOLD_S) == 1.0


def test_no_key_outlives_its_last_press_because_another_one_is_held() -> None:
    """After W is let go, holding A does not extend it beyond the hold of one press."""
    keys = HeldKeys()
    for n in range(30):
        keys.press("w", 0.03 * n)
    last = 0.03 * 29
    for n in range(60):
        keys.press("a", last + 0.02 + 0.03 * n)
    assert keys.value("throttle", last + FIRST_HOLD_S + 1e-6) == 0.0


def test_a_key_that_has_ended_is_not_brought_back_by_another_one() -> None:
    """An expired key stays expired."""
    keys = HeldKeys()
    keys.press("w", 0.0)
    keys.press("w", 0.5)
    assert keys.value("throttle", 0.5 + 1.1 * REPEAT_HOLD_S) == 0.0
    keys.press("a", 0.5 + 1.2 * REPEAT_HOLD_S)
    assert keys.value("throttle", 0.5 + 1.2 * REPEAT_HOLD_S) == 0.0
