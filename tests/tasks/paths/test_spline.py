"""The cubic spline, against that of SciPy, which the package must do without."""

from __future__ import annotations

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings
from scipy.interpolate import CubicSpline

from shapechanger.tasks.paths.sources import Spline

# The same examples every time, so that a failure can be looked at twice.
law = settings(max_examples=60)


@law
@given(
    n=st.integers(3, 60),
    seed=st.integers(0, 2**32 - 1),
    uneven=st.floats(1.0, 1000.0),
    periodic=st.booleans(),
)
@pytest.mark.parametrize("order", [0, 1, 2])
def test_it_is_the_spline_of_scipy(
    order: int, n: int, seed: int, uneven: float, periodic: bool
) -> None:
    """Position, velocity and acceleration, for few points and many, even steps and uneven ones."""
    rng = np.random.default_rng(seed)
    knots = np.concatenate([[0.0], np.cumsum(rng.uniform(1.0, uneven, n - 1))])
    points = rng.normal(size=(n, 3))
    if periodic:
        points[-1] = points[0]
    theirs = CubicSpline(knots, points, bc_type="periodic" if periodic else "natural")
    t = np.concatenate([knots, rng.uniform(0.0, knots[-1], 100)])
    ours = Spline.through(knots, points, periodic).derivative(t, order)
    np.testing.assert_allclose(ours, theirs(t, order), rtol=1e-8, atol=1e-8)


@law
@given(n=st.integers(3, 20), seed=st.integers(0, 2**32 - 1))
def test_it_goes_through_its_points_exactly(n: int, seed: int) -> None:
    """A sample that was recorded is not smoothed away."""
    rng = np.random.default_rng(seed)
    knots = np.concatenate([[0.0], np.cumsum(rng.uniform(0.01, 0.05, n - 1))])
    points = rng.normal(size=(n, 3))
    spline = Spline.through(knots, points, periodic=False)
    np.testing.assert_array_equal(spline.derivative(knots, 0), points)


def test_it_does_not_change_with_the_arrays_it_was_made_of() -> None:
    """A value keeps its own copy, and lets nobody write into it."""
    knots, points = np.arange(4.0), np.ones((4, 3))
    spline = Spline.through(knots, points, periodic=False)
    knots += 1.0
    points += 1.0
    np.testing.assert_array_equal(spline.derivative(np.array([0.0, 3.0]), 0), np.ones((2, 3)))
    with pytest.raises(ValueError, match="read-only"):
        spline.points[0] = 2.0
