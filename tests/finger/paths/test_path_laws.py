"""Properties of all paths."""

from __future__ import annotations

import math
import pickle
from collections.abc import Sequence

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings
from scipy.interpolate import CubicSpline

from shapechanger.errors import PathError
from shapechanger.finger.paths import (
    FASTEST_MPS,
    KINDS,
    FingertipPath,
    as_path,
    circle,
    curve_3d,
    figure_eight,
    from_callable,
    from_csv,
    line,
    sample,
)

law = settings(max_examples=40)

SIZES = st.floats(0.002, 0.04)
RATES = st.floats(0.1, 2.0)
PHASES = st.floats(-7.0, 7.0)
PLACES = st.tuples(*[st.floats(-0.1, 0.1)] * 3)
NORMALS = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda n: math.hypot(*n) > 1e-3)


def wave(t: float) -> tuple[float, float, float]:
    """Return a point that repeats after 2 s."""
    return 0.05 + 0.01 * math.sin(math.pi * t), 0.003 * math.cos(2 * math.pi * t), -0.04


def recording(closed: bool, seed: int) -> FingertipPath:
    """Return a random walk with uneven steps of 8 to 30 ms."""
    rng = np.random.default_rng(seed)
    times = np.concatenate([[0.0], np.cumsum(rng.uniform(0.008, 0.03, 40))])
    points = np.cumsum(rng.normal(0.0, 1e-3, (41, 3)), axis=0)
    if closed:
        points[-1] = points[0]
    spline = CubicSpline(times, points, bc_type="periodic" if closed else "natural")
    return FingertipPath(spline, float(times[-1]), closed)


shapes = st.one_of(
    st.builds(circle, SIZES, PLACES, RATES, NORMALS, PHASES),
    st.builds(figure_eight, SIZES, PLACES, RATES, NORMALS, PHASES),
    st.builds(curve_3d, SIZES, SIZES, PLACES, RATES, NORMALS, PHASES),
    st.builds(
        lambda start, way, hz: line(start, tuple(np.add(start, way)), hz),
        PLACES,
        st.tuples(*[SIZES] * 3),
        RATES,
    ),
)
closed_paths = st.one_of(
    shapes,
    st.just(from_callable(wave, period_s=2.0)),
    st.builds(recording, st.just(True), st.integers(0, 20)),
)
ending_paths = st.one_of(
    st.builds(lambda s: from_callable(wave, duration_s=s), st.floats(0.5, 3.0)),
    st.builds(recording, st.just(False), st.integers(0, 20)),
)


@law
@given(path=closed_paths, part=st.floats(0.0, 1.0), rounds=st.integers(-3, 50))
def test_a_closed_path_repeats(path: FingertipPath, part: float, rounds: int) -> None:
    """Positions are periodic, before 0 s too."""
    assert path.period_s == path.duration_s
    t = part * path.period_s
    np.testing.assert_allclose(path.at(t + rounds * path.period_s), path.at(t), atol=1e-9)


@law
@given(path=closed_paths)
def test_a_closed_path_is_smooth_at_its_seam(path: FingertipPath) -> None:
    """Position and velocity are continuous where a period ends."""
    h = 1e-6
    before, at, after = path.at([path.duration_s - h, path.duration_s, path.duration_s + h])
    np.testing.assert_allclose(before, after, atol=1e-5)
    np.testing.assert_allclose(at - before, after - at, atol=1e-9)


@law
@given(path=ending_paths, later=st.floats(0.01, 100.0))
def test_an_open_path_is_constant_outside(path: FingertipPath, later: float) -> None:
    """Before its start and after its end, an open path stays at the end points."""
    assert path.period_s is None
    for t, end in ((path.duration_s + later, path.duration_s), (-later, 0.0)):
        np.testing.assert_array_equal(path.at(t), path.at(end))


@law
@given(
    path=st.one_of(closed_paths, ending_paths),
    times=st.lists(st.lists(st.floats(-5.0, 5.0), min_size=3, max_size=3), max_size=4),
)
def test_times_are_batched(path: FingertipPath, times: Sequence[Sequence[float]]) -> None:
    """Times of any shape give the same positions as single times."""
    t = np.reshape(np.array(times, dtype=np.float64), (-1, 3))
    answer = path.at(t)
    assert (answer.shape, answer.dtype) == ((*t.shape, 3), np.float64)
    for place in np.ndindex(t.shape):
        alone = path.at(float(t[place]))
        assert alone.shape == (3,)
        np.testing.assert_allclose(answer[place], alone, rtol=1e-12, atol=1e-12)


@law
@given(path=shapes)
def test_no_shape_is_too_fast(path: FingertipPath) -> None:
    """The speed of a shape is at most `FASTEST_MPS`."""
    velocity = path.position(np.linspace(0.0, path.duration_s, 500), 1)
    assert np.linalg.norm(velocity, axis=1).max() <= FASTEST_MPS + 1e-9


@law
@given(path=shapes, digits=st.sampled_from([6, 12]))
def test_a_shape_round_trips_through_csv(
    path: FingertipPath, digits: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Written with six digits and read back, a shape stays closed and within 0.01 mm."""
    times, points = sample(path, hz=100.0)
    rows = [
        ",".join(f"{value:.{digits}f}" for value in (t, *point))
        for t, point in zip(times, points, strict=True)
    ]
    file = tmp_path_factory.mktemp("paths") / "path.csv"
    file.write_text("\n".join(["t,x,y,z", *rows, ""]))
    read = from_csv(file)
    assert read.closed
    np.testing.assert_allclose(read.at(times), points, rtol=0.0, atol=1e-5)
    np.testing.assert_allclose(read.period_s, path.period_s, rtol=1e-5)


@pytest.mark.parametrize("path", [*map(as_path, KINDS), recording(True, 0), recording(False, 1)])
def test_paths_can_be_pickled(path: FingertipPath) -> None:
    copy = pickle.loads(pickle.dumps(path))
    times = np.linspace(-1.0, 3.0, 50)
    np.testing.assert_array_equal(copy.at(times), path.at(times))
    assert (copy.duration_s, copy.closed) == (path.duration_s, path.closed)


@pytest.mark.parametrize("path", [circle(), recording(False, 2), from_callable(wave)])
def test_positions_are_copies(path: FingertipPath) -> None:
    """Writing to a result does not change the path."""
    before = path.at([0.0, 0.3])
    answer = path.at([0.0, 0.3])
    answer += 1.0
    np.testing.assert_array_equal(path.at([0.0, 0.3]), before)


@pytest.mark.parametrize("t", [math.nan, math.inf, [0.0, -math.inf]])
def test_times_must_be_finite(t: float | list[float]) -> None:
    """NaN and infinite times raise an error."""
    with pytest.raises(PathError, match=r"^Times of a path must be finite, got NaN"):
        circle().at(t)


def test_shapes_compare_by_value() -> None:
    assert circle(hz=1.0) == circle(hz=1.0) != circle(hz=1.1)
    assert len({line(), line(), figure_eight()}) == 2
    assert (same := recording(False, 3)) == same != recording(False, 3)
