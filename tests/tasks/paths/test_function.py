"""Paths that are functions: what is tried out when they are made, and what is not taken."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from shapechanger.errors import PathError
from shapechanger.tasks.paths import from_callable

Point = tuple[float, float, float]


def swing(t: float) -> Point:
    """Smooth, and never the same twice."""
    return 0.05 + 0.01 * math.sin(t), 0.005 * math.sin(math.sqrt(2.0) * t), -0.04


def test_positions_are_the_functions_own() -> None:
    """Nothing is rounded or interpolated, and the function sees plain numbers."""
    seen: list[object] = []

    def function(t: float) -> Point:
        seen.append(type(t))
        return swing(t)

    path = from_callable(function)
    np.testing.assert_array_equal(path.at([0.1, 1234.5]), [swing(0.1), swing(1234.5)])
    assert set(seen) == {float}


def test_the_function_is_never_asked_beyond_its_end() -> None:
    """Not even by the last digit of a number, where a root might be of something below 0."""
    seen: list[float] = []

    def function(t: float) -> Point:
        seen.append(t)
        return t, 0.0, 0.0

    path = from_callable(function, duration_s=0.018)
    np.testing.assert_allclose(path.at([-1.0, 0.0, 0.018, 1.0])[:, 0], [0, 0, 0.018, 0.018])
    assert (min(seen), max(seen)) == (0.0, 0.018)


def test_it_goes_on_for_ever_unless_told() -> None:
    """A bare function has no end, and so no length."""
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
    """What the function gave is in the sentence."""
    function: Any = lambda _: given  # noqa: E731  # One line for all of them.
    with pytest.raises(PathError) as caught:
        from_callable(function)
    assert str(caught.value) == (
        "The function of a path must return three finite numbers (x, y, z) in m, and at 0 s it "
        f"returned {given!r}."
    )


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_numbers_are_finite_from_end_to_end(bad: float) -> None:
    """A pole in the middle is found when the path is made, one after the trial when it is met."""
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
    """A hundredth of a millimetre, wherever it is; the sentence says where."""

    def function(t: float) -> Point:
        x, y, z = swing(t)
        return x, y, z + (jump if t > when else -jump if jump > 1 else 0.0)

    with pytest.raises(PathError) as caught:
        from_callable(function, duration_s=4.0)
    said = str(caught.value)
    assert said.endswith("s, and no fingertip is faster than 2 m/s.")
    assert abs(float(said.split()[1]) - when) < 3e-3


@pytest.mark.parametrize(
    "function",
    [
        lambda t: (1.9 * t, 0.0, 0.0),
        lambda t: (0.01 * abs(math.sin(t)), 0.0, 0.0),
        lambda t: [0.05 * math.sqrt(t + 1e-3), 0.0, 0.0],
        lambda t: np.array([0.01, math.floor(t * 100) * 1e-9, 0.0]),
    ],
)
def test_what_is_steep_or_has_corners_does_not_jump(function: Callable[[float], Any]) -> None:
    """Corners are continuous, and steps of a nanometre are rounding."""
    path = from_callable(function, duration_s=2.0)
    np.testing.assert_array_equal(path.at(1.9), np.array(function(1.9)))


@pytest.mark.parametrize("hz", [100.0, 3000.0])
def test_too_fast_is_a_jump(hz: float) -> None:
    """Smooth as it may be, also where whole waves fit between the times at which it is tried."""
    with pytest.raises(PathError, match="no fingertip is faster than 2 m/s"):
        from_callable(lambda t: (0.02 * math.sin(2 * math.pi * hz * t), 0.0, 0.0), duration_s=1.7)


def test_a_period_brings_it_back() -> None:
    """Within 0.1 mm, as a recording that counts as closed."""
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
def test_times_make_sense(times: dict[str, float], message: str) -> None:
    """It ends or it repeats, after some time."""
    with pytest.raises(PathError) as caught:
        from_callable(swing, **times)
    assert str(caught.value) == message


def test_what_the_function_raises_comes_through() -> None:
    """Its own traceback says more than any sentence of ours."""
    with pytest.raises(ZeroDivisionError):
        from_callable(lambda t: (1 / t, 0.0, 0.0))
