"""Keys that hold the robot's steering and throttle, and the terminal that reads them."""

import os
import sys
import termios

import pytest

from shapechanger.robot.client.teleop import (
    DIRECTIONS,
    FIRST_HOLD_S,
    REPEAT_HOLD_S,
    HeldKeys,
    NoTerminal,
    Terminal,
)

W_FOR_1_S = [("w", 0.033 * n) for n in range(31)]
LAST_S = W_FOR_1_S[-1][1]
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
        # A held key continues when another one is pressed, which does not extend its hold.
        ([*W_FOR_1_S, ("a", LAST_S + 0.02)], LAST_S + FIRST_HOLD_S, 1.0, -1.0),
        (
            [*W_FOR_1_S, *(("a", LAST_S + 0.03 * n) for n in range(1, 60))],
            LAST_S + FIRST_HOLD_S + JUST,
            0.0,
            -1.0,
        ),
        # Another key does not revive an expired one.
        (
            [("w", 0.0), ("w", 0.5), ("a", 0.5 + 1.2 * REPEAT_HOLD_S)],
            0.5 + 1.2 * REPEAT_HOLD_S,
            0.0,
            -1.0,
        ),
    ],
)
def test_a_press_holds_until_its_time(
    presses: list[tuple[str, float]], now_s: float, throttle: float, steering: float
) -> None:
    keys = HeldKeys()
    for key, pressed_s in presses:
        keys.press(key, pressed_s)
    assert (keys.value("throttle", now_s), keys.value("steering", now_s)) == (throttle, steering)
    keys.let_go()
    assert (keys.value("throttle", now_s), keys.value("steering", now_s)) == (0.0, 0.0)


def test_driving_needs_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    with open(os.devnull) as nothing:
        monkeypatch.setattr(sys, "stdin", nothing)
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
