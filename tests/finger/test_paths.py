"""Paths: laws of all paths, shapes, functions of time, and CSV files."""

import math
import pickle
from collections.abc import Callable, Sequence
from pathlib import Path as File
from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings
from scipy.interpolate import CubicSpline

from shapechanger.errors import PathError, UnknownName
from shapechanger.finger.paths import (
    FASTEST_MPS,
    KINDS,
    FingertipPath,
    as_path,
    circle,
    figure_eight,
    from_callable,
    from_csv,
    line,
)

law = settings(max_examples=40)

SIZES = st.floats(0.002, 0.04)
RATES = st.floats(0.1, 2.0)
PHASES = st.floats(-7.0, 7.0)
PLACES = st.tuples(*[st.floats(-0.1, 0.1)] * 3)
NORMALS = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda n: math.hypot(*n) > 1e-3)
CENTRE = np.array([0.05, 0.0, -0.045])
DISTAL, RADIAL, DORSAL = np.eye(3)
Point = tuple[float, float, float]


def wave(t: float) -> Point:
    """Return a point that repeats after 2 s."""
    return 0.05 + 0.01 * math.sin(math.pi * t), 0.003 * math.cos(2 * math.pi * t), -0.04


def recording(closed: bool, seed: int) -> FingertipPath:
    """Return a path through a random walk with time steps of 8 to 30 ms."""
    rng = np.random.default_rng(seed)
    times = np.concatenate([[0.0], np.cumsum(rng.uniform(0.008, 0.03, 40))])
    points = np.cumsum(rng.normal(0.0, 1e-3, (41, 3)), axis=0)
    if closed:
        points[-1] = points[0]
    spline = CubicSpline(times, points, bc_type="periodic" if closed else "natural")
    return FingertipPath(spline, float(times[-1]), closed)


shapes = st.one_of(
    st.builds(circle, SIZES, PLACES, RATES, NORMALS, PHASES),
    st.builds(figure_eight, SIZES, PLACES, RATES, NORMALS, PHASES, st.floats(-0.04, 0.04)),
    st.builds(
        lambda start, way, hz: line(start, tuple(np.add(start, way)), hz),
        PLACES,
        st.tuples(*[SIZES] * 3),
        RATES,
    ),
)
closed_paths = st.one_of(shapes, st.builds(recording, st.just(True), st.integers(0, 20)))
ending_paths = st.builds(recording, st.just(False), st.integers(0, 20))


@law
@given(path=closed_paths, part=st.floats(0.0, 1.0), rounds=st.integers(-3, 50))
def test_a_closed_path_repeats_without_a_seam(
    path: FingertipPath, part: float, rounds: int
) -> None:
    """Positions are periodic, also before 0 s; position and velocity are continuous."""
    t = part * path.duration_s
    np.testing.assert_allclose(path.at(t + rounds * path.duration_s), path.at(t), atol=1e-9)
    h = 1e-6
    before, at, after = path.at([path.duration_s - h, path.duration_s, path.duration_s + h])
    np.testing.assert_allclose(before, after, atol=1e-5)
    np.testing.assert_allclose(at - before, after - at, atol=1e-9)


@law
@given(path=ending_paths, later=st.floats(0.01, 100.0))
def test_an_open_path_is_constant_outside(path: FingertipPath, later: float) -> None:
    assert not path.closed
    for t, end in ((path.duration_s + later, path.duration_s), (-later, 0.0)):
        np.testing.assert_array_equal(path.at(t), path.at(end))


@law
@given(
    path=st.one_of(closed_paths, ending_paths),
    times=st.lists(st.lists(st.floats(-5.0, 5.0), min_size=3, max_size=3), max_size=4),
)
def test_times_are_batched(path: FingertipPath, times: Sequence[Sequence[float]]) -> None:
    t = np.reshape(np.array(times, dtype=np.float64), (-1, 3))
    answer = path.at(t)
    assert (answer.shape, answer.dtype) == ((*t.shape, 3), np.float64)
    for place in np.ndindex(t.shape):
        alone = path.at(float(t[place]))
        assert alone.shape == (3,)
        np.testing.assert_allclose(answer[place], alone, rtol=1e-12, atol=1e-12)


@law
@given(path=shapes, digits=st.sampled_from([6, 12]))
def test_a_shape_round_trips_through_csv(
    path: Any, digits: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    times = np.linspace(0.0, path.duration_s, 1 + math.ceil(100.0 * path.duration_s))
    points = path.at(times)
    assert np.linalg.norm(path.position(times, 1), axis=1).max() <= FASTEST_MPS + 1e-9
    rows = [
        ",".join(f"{value:.{digits}f}" for value in (t, *point))
        for t, point in zip(times, points, strict=True)
    ]
    file = tmp_path_factory.mktemp("paths") / "path.csv"
    file.write_text("\n".join(["t,x,y,z", *rows, ""]))
    read = from_csv(file)
    assert read.closed
    np.testing.assert_allclose(read.at(times), points, rtol=0.0, atol=1e-5)
    np.testing.assert_allclose(read.duration_s, path.duration_s, rtol=1e-5)


@pytest.mark.parametrize(
    "path", [*map(as_path, KINDS), recording(True, 0), recording(False, 1), from_callable(wave)]
)
def test_paths_are_immutable(path: FingertipPath) -> None:
    """A pickled path has the same positions; changing a result does not change the path."""
    times = np.linspace(-1.0, 3.0, 50)
    copy = pickle.loads(pickle.dumps(path))
    before = path.at(times)
    answer = path.at(times)
    answer += 1.0
    np.testing.assert_array_equal(copy.at(times), before)
    np.testing.assert_array_equal(path.at(times), before)
    assert (copy.duration_s, copy.closed) == (path.duration_s, path.closed)
    assert circle(hz=1.0) == circle(hz=1.0) != circle(hz=1.1)


@pytest.mark.parametrize(
    ("normal", "length"),
    [((0, 1, 0), 1), ((0, 0, -3), 3), ((1, 0, 0), 1), ((2, 3, 6), 7), ((1e-200, 0, 0), 1e-200)],
)
def test_a_circle_is_round(normal: Point, length: float) -> None:
    """Points are in the plane, at the radius, and turn around the normal at constant speed."""
    path: Any = circle(0.01, hz=2.0, normal=normal)
    t = np.linspace(0.0, 0.5, 100)
    arms, velocity = path.at(t) - CENTRE, path.position(t, 1)
    unit, rate = np.array(normal) / length, 4 * math.pi  # rad/s
    np.testing.assert_allclose(np.linalg.norm(arms, axis=1), 0.01)
    np.testing.assert_allclose(arms @ unit, 0.0, atol=1e-12)
    np.testing.assert_allclose(velocity, rate * np.cross(unit, arms), atol=1e-12)
    np.testing.assert_allclose(circle().at(0.0), CENTRE + 0.012 * DISTAL)
    with pytest.raises(PathError, match=r"^Times of a path must be finite, got NaN"):
        path.at([0.0, math.nan])


def test_a_figure_eight_crosses_itself_once() -> None:
    """Its loops turn in opposite directions; a depth bends it along the normal only."""
    path: Any = figure_eight(0.02)
    t = np.linspace(0.0, 2.0, 2001)
    points = path.at(t) - CENTRE
    np.testing.assert_allclose(points[[0, 1000]], 0.0, atol=1e-15)
    towards, back = path.position(np.array([0.0, 1.0]), 1)
    assert towards @ DISTAL > 0 > back @ DISTAL
    np.testing.assert_allclose(np.ptp(points, axis=0), [0.02, 0.0, 0.01], atol=1e-6)
    for half, sign in ((points[:1001], -1), (points[1000:], 1)):
        # If the normal points to the viewer and distal is right, palmar is up.
        right, up = half @ DISTAL, half @ -DORSAL
        assert np.sign(np.sum(right[:-1] * up[1:] - right[1:] * up[:-1])) == sign
    bent = figure_eight(0.02, depth=0.006).at(t) - CENTRE
    np.testing.assert_allclose(bent[:, [0, 2]], points[:, [0, 2]], atol=1e-12)
    np.testing.assert_allclose((bent @ RADIAL)[[0, 500, 1000, 1500]], [-0.003, 0.003] * 2)


@pytest.mark.parametrize("make", [circle, figure_eight])
@pytest.mark.parametrize("phase", [-1.0, 0.3, 2.0])
def test_a_phase_is_a_shift_in_time(make: Callable[..., FingertipPath], phase: float) -> None:
    t = np.linspace(0.0, 4.0, 50)
    later = make(hz=0.25).at(t + phase / (2 * math.pi * 0.25))
    np.testing.assert_allclose(make(hz=0.25, phase=phase).at(t), later, atol=1e-12)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: circle(radius=0.0), "The radius of a circle must be a finite number above 0"),
        (lambda: circle(radius="1"), "must be a finite number above 0, got '1'"),
        (lambda: circle(radius=True), "must be a finite number above 0, got True"),
        (lambda: circle(phase=math.inf), "The phase of a circle must be a finite number, got inf"),
        (lambda: circle(centre=(0.0, 0.0)), "The centre of a circle must be three finite numbers"),
        (lambda: circle(normal=(0, 0, 0)), "The normal of a plane must not be"),
        (lambda: circle(radius=0.05, hz=10.0), "A circle .* faster than 2 m/s, got 3.14 m/s"),
        (lambda: figure_eight(depth=math.nan), "The depth of a figure eight must be a finite"),
        (lambda: line((1, 2, 3), (1, 2, 3)), "The ends of a line must differ"),
        (lambda: line(end=[1, 2, "c"]), "The end of a line must be three finite numbers"),
    ],
)
def test_invalid_arguments_are_refused(make: Callable[[], Any], message: str) -> None:
    with pytest.raises(PathError, match=message):
        make()


def test_a_function_determines_the_positions() -> None:
    """Positions are exact; the function is called with floats from 0 s on."""
    seen: list[float] = []

    def function(t: float) -> Point:
        seen.append(t)
        return t, 0.0, 0.0

    path = from_callable(function)
    np.testing.assert_array_equal(path.at([-1.0, 0.001, 60.0])[:, 0], [0, 0.001, 60.0])
    assert (min(seen), {type(t) for t in seen}) == (0.0, {float})
    assert (path.duration_s, path.closed) == (math.inf, False)


@pytest.mark.parametrize("given", [(0.0, 0.0), "abc", (0.0, 0.0, "z"), None, (0, 0, math.nan)])
def test_a_point_is_three_finite_numbers(given: object) -> None:
    """Any other result is refused at any time of the path, and the error shows it."""
    function: Any = lambda t: given if t > 60.0 else (0.0, 0.0, 0.0)  # noqa: E731
    path = from_callable(function)
    for fails in (lambda: path.at([59.0, 61.0]), lambda: from_callable(lambda _: given)):
        with pytest.raises(PathError, match="it returned") as caught:
            fails()
        assert repr(given) in str(caught.value)
    with pytest.raises(ZeroDivisionError):  # The function's own errors are not wrapped.
        from_callable(lambda t: (1 / t, 0.0, 0.0))


@pytest.mark.parametrize(
    ("function", "when"),
    [
        (lambda t: (0.0, 0.0, 0.005 if t > 1.2345 else 0.0), 1.234),
        (lambda t: (0.0, 1e308 if t > 9.9991 else -1e308, 0.0), 9.998),
        (lambda t: (2.1 * t, 0.0, 0.0), 0.0),
    ],
)
def test_a_function_that_jumps_is_refused(function: Callable[[float], Point], when: float) -> None:
    with pytest.raises(PathError, match=rf"^At {when:g} s .* must not be faster than 2 m/s"):
        from_callable(function)
    from_callable(lambda t: (1.9 * t, 0.01 * abs(math.sin(t)), 0.0))


GOOD = "t,x,y,z\n0,0.05,0,0\n0.1,0.06,0,0\n0.2,0.07,0.01,0\n0.3,0.08,0.01,0\n"


@pytest.fixture
def write(tmp_path: File) -> Callable[[str], File]:
    def put(text: str) -> File:
        file = tmp_path / "path.csv"
        file.write_bytes(text.encode())
        return file

    return put


@pytest.mark.parametrize(
    "text",
    [
        GOOD.replace("\n", "\r\n"),
        GOOD.replace("\n", "\n\n"),
        "\ufeff" + GOOD,
        GOOD.replace(",", " , "),
        "z,t,y,x\n0,0,0,.05\n0,.1,0,6e-2\n0,.2,.01,.07\n0,.3,.01,.08",
        '"t","x","y","z"\n7.5,0.05,0,0\n7.6,0.06,0,0\n7.7,0.07,0.01,0\n7.8,0.08,0.01,0\n',
    ],
    ids=["CRLF", "empty lines", "BOM", "spaces", "order", "offset and quotes"],
)
def test_formats_of_csv(write: Callable[[str], File], text: str) -> None:
    path = from_csv(str(write(text)))
    assert not path.closed
    assert path.duration_s == pytest.approx(0.3)
    np.testing.assert_allclose(
        path.at([0.0, 0.1, 0.2, 0.3]),
        [[0.05, 0, 0], [0.06, 0, 0], [0.07, 0.01, 0], [0.08, 0.01, 0]],
        atol=1e-12,
    )


def test_a_file_that_returns_to_its_start_is_closed(write: Callable[[str], File]) -> None:
    """Ends within 0.1 mm of each other are replaced by their mean."""
    rows = "t,x,y,z\n0,0.05,0,0\n0.1,0.06,0.01,0\n0.2,0.05,0.02,0\n0.3,{end},0,0\n"
    closed = from_csv(write(rows.format(end=0.05009)))
    assert closed.closed
    np.testing.assert_allclose(closed.at([0.0, 0.3]), [[0.050045, 0, 0]] * 2, atol=1e-12)
    ending = from_csv(write(rows.format(end=0.05011)))
    assert not ending.closed
    np.testing.assert_allclose(ending.at(9.0), [0.05011, 0, 0], atol=1e-12)


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ([], "must have at least 3 rows, got 0"),
        (["0,0,0,0", "1,0,0,0"], "must have at least 3 rows, got 2"),
        (["0,0,0,0", "", "1,0,0"], "line 4: a row must be four finite numbers, got '1,0,0'"),
        (["0,0,0,0", "-inf,0,0,0"], "line 3: a row must be four finite numbers"),
        (["0,0,0,0", "0.2,0,0,0", "", "0.2,0,0,0"], "line 5: time must increase, .* from 0.2 s to"),
        (["0,0,0,0", "0.1,0,0,0", "0.2,0,0,0", "0.8,0,0,0"], "line 5: .* from 0.2 s to 0.8 s"),
        (["0,0,0,0", "0.1,0,0,0", "0.2,0.3,0,0"], "line 4: the point moves 0.3 m in 0.1 s"),
        (['0,0,0,"0'], "cannot be read: unexpected end of data"),
    ],
)
def test_invalid_files_are_refused(
    write: Callable[[str], File], rows: list[str], message: str
) -> None:
    with pytest.raises(PathError, match=f"path.csv.*{message}"):
        from_csv(write("\n".join(["t,x,y,z", *rows, ""])))


def test_unreadable_files_and_other_columns_are_refused(write: Callable[[str], File]) -> None:
    for text, names in (("\n\n", "none"), ("t,x,x,y,z\n", "t, x, x, y, z")):
        with pytest.raises(PathError, match=f"names the columns {names} in its first line"):
            from_csv(write(text))
    file = write(GOOD)
    file.write_bytes(b"t,x,y,z\n\xff\xfe\n")
    for unread, why in ((file, "not UTF-8"), (file.with_name("x"), "cannot be read: No such")):
        with pytest.raises(PathError, match=f"{unread.name} .*{why}"):
            from_csv(unread)


@pytest.mark.parametrize("kind", KINDS)
def test_a_shape_can_be_given_with_settings(kind: str) -> None:
    given = {"kind": kind, "hz": 0.5}
    assert as_path(kind) == as_path(given) == as_path(as_path(kind)) != as_path(given | {"hz": 0.4})
    assert "kind" in given  # The mapping is not modified.
    assert as_path("curve") == figure_eight(depth=0.008) != as_path("figure-eight")


def test_files_and_functions_are_paths(write: Callable[[str], File]) -> None:
    file = write(GOOD)
    upper = file.rename(file.with_suffix(".CSV"))
    for one in (upper, str(upper)):
        np.testing.assert_allclose(as_path(one).at(0.1), [0.06, 0, 0])
    assert as_path(wave).duration_s == math.inf


@pytest.mark.parametrize(
    ("given", "error", "message"),
    [
        ("figure_eight", UnknownName, r"No path .*Did you mean 'figure-eight'\? There are: circle"),
        ({"kind": "cirle"}, UnknownName, "No path matches 'cirle'. Did you mean 'circle'"),
        ({"kind": "circle", "raduis": 1}, UnknownName, "setting of 'circle' .*mean 'radius'"),
        ({"kind": "line", 3: 0.01}, UnknownName, "No setting of 'line' matches '3'"),
        ({"kind": "circle", "radius": "wide"}, PathError, "The radius of a circle must be a"),
        ({"radius": 0.01}, PathError, 'one of circle, .* with such a name as "kind"'),
        (File("path.txt"), PathError, "a .csv file or a function of time, got .*path.txt"),
        (3, PathError, "a function of time, got 3"),
    ],
)
def test_other_objects_are_refused(given: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        as_path(given)
