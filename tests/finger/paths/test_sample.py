"""Sampling of paths."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shapechanger.errors import PathError
from shapechanger.finger.paths import circle, from_callable, sample


@pytest.mark.parametrize(
    ("duration_s", "hz", "n"), [(2.0, 50.0, 101), (1.1, 50.0, 56), (1.0, 2.5, 4), (1.0, 0.1, 2)]
)
def test_both_ends_are_sampled(duration_s: float, hz: float, n: int) -> None:
    """Samples are evenly spaced at `hz` or more, and include both ends."""
    path = from_callable(lambda t: (0.1 * t, 0.0, 0.0), duration_s=duration_s)
    times, points = sample(path, hz)
    assert (times.shape, points.shape) == ((n,), (n, 3))
    assert (times[0], times[-1]) == (0.0, duration_s)
    np.testing.assert_allclose(np.diff(times), duration_s / (n - 1))
    np.testing.assert_allclose(points[:, 0], 0.1 * times, atol=1e-12)


def test_a_closed_path_is_sampled_for_one_period() -> None:
    """The last sample equals the first."""
    times, points = sample(circle(hz=0.25), hz=10.0)
    assert times[-1] == 4.0
    np.testing.assert_allclose(points[-1], points[0], atol=1e-15)
    assert len(np.unique(points[:-1].round(9), axis=0)) == 40


def test_the_duration_can_be_given() -> None:
    """A path without an end needs `duration_s`."""
    times, _ = sample(circle(hz=1.0), hz=10.0, duration_s=2.5)
    assert (len(times), times[-1]) == (26, 2.5)
    endless = from_callable(lambda t: (0.01 * math.sin(t), 0.0, 0.0))
    assert sample(endless, hz=10.0, duration_s=20.0)[1].shape == (201, 3)
    with pytest.raises(PathError) as caught:
        sample(endless, hz=10.0)
    assert str(caught.value) == ("This path neither ends nor repeats, so it needs duration_s.")


@pytest.mark.parametrize("hz", [0.0, -1.0, math.nan, math.inf])
def test_rates_must_be_positive(hz: float) -> None:
    with pytest.raises(PathError, match=r"^hz must be a finite number above 0, got "):
        sample(circle(), hz)
    with pytest.raises(PathError, match=r"^duration_s must be a finite number above 0, got "):
        sample(circle(), 1.0, duration_s=hz)
