"""Paths from functions, and the checks when they are made."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from shapechanger.errors import PathError
from shapechanger.finger.paths import from_callable

Point = tuple[float, float, float]


def swing(t: float) -> Point:
    """Return a smooth point that never repeats."""
    return 0.05 + 0.01 * math.sin(t), 0.005 * math.sin(math.sqrt(2.0) * t), -0.04


def test_positions_are_those_of_the_function() -> None:
    """Positions are neither rounded nor interpolated; the function gets a float."""
    seen: list[object] = []

    def function(t: float) -> Point:
        seen.append(type(t))
        return swing(t)

    path = from_callable(function)
    np.testing.assert_array_equal(path.at([0.1, 1234.5]), [swing(0.1), swing(1234.5)])
    assert set(seen) == {float}


def test_function_is_not_called_beyond_its_end() -> None:
    """Times are clipped exactly to the duration."""
    seen: list[float] = []

    def function(t: float) -> Point:
        seen.append(t)
        return t, 0.0, 0.0

    path = from_callable(function, duration_s=0.018)
    np.testing.assert_allclose(path.at([-1.0, 0.0, 0.018, 1.0])[:, 0], [0, 0, 0.018, 0.018])
    assert (min(seen), max(seen)) == (0.0, 0.018)


def test_duration_is_infinite_by_default() -> None:
    """A function has no end unless a duration or a period is given."""
    path = from_callable(swing)
    assert (path.duration_s, path.period_s, path.closed) == (math.inf, None, False)
    ending, repeating = from_callable(swing, 3.0), from_callable(lambda _: (0, 0, 0), period_s=3.0)
    assert (ending.duration_s, ending.period_s) == (3.0, None)
    assert (repeating.duration_s, repeating.period_s) == (3.0, 3.0)


@pytest.mark.parametrize(
    "given",
    [(0.0, 0.0), 0.0, "abc", (0.0, 0.0, "z"), None, [[0.0, 0.0, 0.0]], (0, 0, 1j), [1, [2]]],
)
def test_a_point_is_three_numbers(given: object) -> None:
    """Other return values raise an error that shows them."""
    function: Any = lambda _: given  # noqa: E731  # One line for all cases.
    with pytest.raises(PathError) as caught:
        from_callable(function)
    assert str(caught.value) == (
        "The function of a path must return three finite numbers (x, y, z) in m, and at 0 s it "
        f"returned {given!r}."
    )


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_positions_must_be_finite(bad: float) -> None:
    """A non-finite value raises when the path is made, or beyond the trial when it is evaluated."""
    with pytest.raises(
        PathError, match=r"three finite numbers .* at 3 s it returned \(0\.0, 0\.0, "
    ):
        from_callable(lambda t: (0.0, 0.0, bad if t == 3.0 else 0.0), duration_s=4.0)
    path = from_callable(lambda t: (0.0, 0.0, bad if t > 60.0 else 0.0))
    with pytest.raises(
        PathError, match=r"three finite numbers .* at 61 s it returned \(0\.0, 0\.0, "
    ):
        path.at([59.0, 61.0])


@pytest.mark.parametrize("jump", [1e-5, 1e-3, 0.5, 1e308])
@pytest.mark.parametrize("when", [0.0007, 1.23456, 3.999])
def test_a_jump_is_found(jump: float, when: float) -> None:
    """Jumps from 0.01 mm on are found at any time, and the error states where."""

    def function(t: float) -> Point:
        x, y, z = swing(t)
        return x, y, z + (jump if t > when else -jump if jump > 1 else 0.0)

    with pytest.raises(PathError) as caught:
        from_callable(function, duration_s=4.0)
    message = str(caught.value)
    assert message.endswith("s, and no fingertip is faster than 2 m/s.")
    assert abs(float(message.split()[1]) - when) < 3e-3


@pytest.mark.parametrize(
    "function",
    [
        lambda t: (1.9 * t, 0.0, 0.0),
        lambda t: (0.01 * abs(math.sin(t)), 0.0, 0.0),
        lambda t: [0.05 * math.sqrt(t + 1e-3), 0.0, 0.0],
        lambda t: np.array([0.01, math.floor(t * 100) * 1e-9, 0.0]),
    ],
)
def test_steep_slopes_and_corners_are_not_jumps(function: Callable[[float], Any]) -> None:
    """Corners are continuous, and steps of 1 nm count as rounding."""
    path = from_callable(function, duration_s=2.0)
    np.testing.assert_array_equal(path.at(1.9), np.array(function(1.9)))


@pytest.mark.parametrize("hz", [100.0, 3000.0])
def test_a_path_that_is_too_fast_is_refused(hz: float) -> None:
    """Fast oscillations are found, even where whole periods fit between the samples."""
    with pytest.raises(PathError, match="no fingertip is faster than 2 m/s"):
        from_callable(lambda t: (0.02 * math.sin(2 * math.pi * hz * t), 0.0, 0.0), duration_s=1.7)


def test_a_period_must_return_to_the_start() -> None:
    with pytest.raises(PathError) as caught:
        from_callable(lambda t: (0.001 * t, 0.0, 0.0), period_s=3.0)
    assert str(caught.value) == (
        "After its period of 3 s the path is 3 mm from its beginning, and 0.1 mm are allowed: "
        "give another period_s, or duration_s for an open path."
    )
    with pytest.raises(PathError, match=r"is 0\.12 mm from its beginning"):
        from_callable(lambda t: (0.00004 * t, 0.0, 0.0), period_s=3.0)
    path = from_callable(lambda t: (0.00003 * t, 0.0, 0.0), period_s=3.0)
    np.testing.assert_allclose(path.at([2.9999, 3.0])[:, 0], [8.9997e-5, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("times", "message"),
    [
        ({"duration_s": 0.0}, "duration_s must be a finite number above 0, got 0.0."),
        ({"period_s": math.nan}, "period_s must be a finite number above 0, got nan."),
        ({"period_s": math.inf}, "period_s must be a finite number above 0, got inf."),
        (
            {"duration_s": 1.0, "period_s": 1.0},
            "A path ends after duration_s or repeats after period_s; give only one of them.",
        ),
    ],
)
def test_invalid_durations_are_refused(times: dict[str, float], message: str) -> None:
    """Duration and period must be positive and finite, and exclude each other."""
    with pytest.raises(PathError) as caught:
        from_callable(swing, **times)
    assert str(caught.value) == message


def test_errors_of_the_function_propagate() -> None:
    """Exceptions of the function are not wrapped."""
    with pytest.raises(ZeroDivisionError):
        from_callable(lambda t: (1 / t, 0.0, 0.0))
