"""Closed lines: stations, nearest points and progress."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.vehicles.courses.geometry import ClosedLine, CourseProgress
from tests.vehicles.expert.courses import ring

_SQUARE = ClosedLine(np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)]))
_RING = ClosedLine(ring(0).route)


def test_signed_distances_of_a_square() -> None:
    """The left of a counter-clockwise line is its inside, with positive distances."""
    assert _SQUARE.length == 16.0
    assert _SQUARE.nearest(1.0, 0.5) == pytest.approx((1.0, 0.5))
    assert _SQUARE.nearest(1.0, -0.5) == pytest.approx((1.0, -0.5))
    assert _SQUARE.nearest(-0.5, 1.0) == pytest.approx((15.0, -0.5))


@given(station=st.floats(-200.0, 200.0))
def test_at_inverts_nearest(station: float) -> None:
    """Stations wrap around."""
    x, y = _RING.at(station)
    spot = _RING.nearest(x, y)
    assert abs(_RING.ahead_by(station, spot.station)) < 1e-6
    assert abs(spot.lateral) < 1e-6


def test_a_hint_selects_the_leg() -> None:
    """With a hint, a nearer parallel leg is ignored."""
    there = [(x, 0.0) for x in np.arange(0.0, 20.0, 0.1)]
    back = [(x, 1.0) for x in np.arange(20.0, 0.0, -0.1)]
    line = ClosedLine(np.array(there + back))
    assert line.nearest(10.0, 0.9).station > 20
    assert line.nearest(10.0, 0.9, hint=9.8).station == pytest.approx(10.0)


def test_progress_counts_laps_and_counts_down() -> None:
    """Progress counts whole laps, and backward motion subtracts."""
    course = ring(0)
    line = ClosedLine(course.route)
    progress = CourseProgress(course)
    progress.reset(*line.at(5.0))
    metres = 0.0
    for station in np.arange(5.0, 5.0 + 3 * line.length, 0.1):
        metres = progress.update(*line.at(float(station)))
    assert metres == pytest.approx(3 * line.length, abs=0.2)
    for station in np.arange(5.0 + 3 * line.length, 4.0, -0.1):
        metres = progress.update(*line.at(float(station)))
    assert metres == pytest.approx(-1.0, abs=0.2)
