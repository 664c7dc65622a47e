"""Position, phase and direction of the shapes."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from shapechanger.errors import PathError
from shapechanger.finger.paths import FingertipPath, circle, curve_3d, figure_eight, line

CENTRE = np.array([0.05, 0.0, -0.045])
DISTAL, RADIAL, DORSAL = np.eye(3)


@pytest.mark.parametrize(
    ("normal", "length"),
    [((0, 1, 0), 1), ((0, 0, -3), 3), ((1, 0, 0), 1), ((2, 3, 6), 7), ((1e-200, 0, 0), 1e-200)],
)
def test_a_circle_is_round(normal: tuple[float, float, float], length: float) -> None:
    """Points are in the plane, at the radius, and turn counter-clockwise at constant speed."""
    path = circle(0.01, hz=2.0, normal=normal)
    t = np.linspace(0.0, 0.5, 100)
    arms, velocity = path.at(t) - CENTRE, path.position(t, 1)
    unit, rate = np.array(normal) / length, 4 * math.pi  # rad/s
    np.testing.assert_allclose(np.linalg.norm(arms, axis=1), 0.01)
    np.testing.assert_allclose(arms @ unit, 0.0, atol=1e-12)
    np.testing.assert_allclose(velocity, rate * np.cross(unit, arms), atol=1e-12)


def test_a_circle_starts_distally_and_goes_palmar() -> None:
    """Phase 0 is the distal point; the direction is palmar."""
    np.testing.assert_allclose(circle().at(0.0), CENTRE + 0.012 * DISTAL)
    np.testing.assert_allclose(circle().at(0.5), CENTRE - 0.012 * DORSAL)
    np.testing.assert_allclose(circle(normal=(1, 0, 0)).at(0.0), CENTRE + 0.012 * DORSAL)
    np.testing.assert_allclose(circle(phase=math.pi / 2).at(0.0), circle().at(0.5))


def test_a_figure_eight_crosses_itself_once() -> None:
    """The path passes its centre twice a period, and the loops turn in opposite directions."""
    path = figure_eight(0.02)
    np.testing.assert_allclose(path.at([0.0, 1.0]), [CENTRE, CENTRE], atol=1e-15)
    towards, back = path.position(np.array([0.0, 1.0]), 1)
    assert towards @ DISTAL > 0 > back @ DISTAL
    assert abs(towards @ back) < 0.9 * np.linalg.norm(towards) * np.linalg.norm(back)
    points = path.at(np.linspace(0.0, 2.0, 2001)) - CENTRE
    np.testing.assert_allclose(np.ptp(points, axis=0), [0.02, 0.0, 0.01], atol=1e-6)
    for half, sign in ((points[:1001], -1), (points[1000:], 1)):
        # With the normal towards the viewer, palmar is up where distal is right.
        right, up = half @ DISTAL, half @ -DORSAL
        assert np.sign(np.sum(right[:-1] * up[1:] - right[1:] * up[:-1])) == sign


@pytest.mark.parametrize("make", [circle, figure_eight, curve_3d])
@pytest.mark.parametrize("phase", [-1.0, 0.3, 2.0])
def test_a_phase_is_a_shift_in_time(make: Callable[..., FingertipPath], phase: float) -> None:
    t = np.linspace(0.0, 4.0, 50)
    ahead = phase / (2 * math.pi * 0.25)  # s
    np.testing.assert_allclose(
        make(hz=0.25, phase=phase).at(t), make(hz=0.25).at(t + ahead), atol=1e-12
    )


def test_a_line_rests_at_both_ends() -> None:
    """A line goes there and back in one period, fastest in the middle."""
    path = line((0.06, 0.0, -0.04), (0.04, 0.0, -0.04), hz=0.25)
    np.testing.assert_allclose(
        path.at([0.0, 1.0, 2.0, 4.0])[:, 0], [0.06, 0.05, 0.04, 0.06], rtol=1e-12
    )
    speeds = np.linalg.norm(path.position(np.array([0.0, 1.0, 2.0, 3.0]), 1), axis=1)
    np.testing.assert_allclose(
        speeds, [0.0, 0.01 * math.pi / 2, 0.0, 0.01 * math.pi / 2], atol=1e-12
    )


def test_a_curve_is_a_bent_figure_eight() -> None:
    """Seen along the normal it is the figure eight; along the normal it has the given depth."""
    t = np.linspace(0.0, 2.0, 2001)
    bent, flat = curve_3d(0.02, depth=0.006).at(t), figure_eight(0.02).at(t)
    np.testing.assert_allclose(bent[:, [0, 2]], flat[:, [0, 2]], atol=1e-12)
    np.testing.assert_allclose((bent @ RADIAL)[[0, 500, 1000, 1500]], [-0.003, 0.003] * 2)
    assert np.linalg.matrix_rank(bent - bent.mean(axis=0), tol=1e-6) == 3
    assert np.linalg.matrix_rank(flat - flat.mean(axis=0), tol=1e-6) == 2


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: circle(radius=0.0),
            "The radius of a circle must be a finite number above 0, got 0.0.",
        ),
        (
            lambda: circle(radius=math.nan),
            "The radius of a circle must be a finite number above 0, got nan.",
        ),
        (
            lambda: circle(radius="1"),
            "The radius of a circle must be a finite number above 0, got '1'.",
        ),
        (
            lambda: circle(radius=True),
            "The radius of a circle must be a finite number above 0, got True.",
        ),
        (lambda: circle(hz=-1), "The hz of a circle must be a finite number above 0, got -1."),
        (
            lambda: circle(phase=math.inf),
            "The phase of a circle must be a finite number, got inf.",
        ),
        (
            lambda: circle(centre=(0.0, 0.0)),
            "The centre of a circle must be three finite numbers (x, y, z), got (0.0, 0.0).",
        ),
        (
            lambda: circle(centre="abc"),
            "The centre of a circle must be three finite numbers (x, y, z), got 'abc'.",
        ),
        (
            lambda: circle(normal=(0.0, 1.0, math.nan)),
            "The normal of a plane must be three finite numbers (x, y, z), got (0.0, 1.0, nan).",
        ),
        (
            lambda: circle(normal=(0, 0, 0)),
            "The normal of a plane must not be (0, 0, 0): it has no direction.",
        ),
        (
            lambda: circle(radius=0.05, hz=10.0),
            "This circle is as fast as 3.14 m/s, and no fingertip is faster than 2 m/s: make it "
            "smaller, or hz lower.",
        ),
        (
            lambda: circle(radius=1e300, hz=1e300),
            "This circle is as fast as inf m/s, and no fingertip is faster than 2 m/s: make it "
            "smaller, or hz lower.",
        ),
        (
            lambda: figure_eight(size=-0.1),
            "The size of a figure eight must be a finite number above 0, got -0.1.",
        ),
        (lambda: curve_3d(size=0), "The size of a curve must be a finite number above 0, got 0."),
        (lambda: curve_3d(depth=0), "The depth of a curve must be a finite number above 0, got 0."),
        (
            lambda: line((1, 2, 3), (1, 2, 3)),
            "A line must end elsewhere than it starts, got (1, 2, 3) twice.",
        ),
        (
            lambda: line(start=None),
            "The start of a line must be three finite numbers (x, y, z), got None.",
        ),
        (
            lambda: line(end=[1, 2, "c"]),
            "The end of a line must be three finite numbers (x, y, z), got [1, 2, 'c'].",
        ),
    ],
)
def test_invalid_arguments_are_refused(make: Callable[[], FingertipPath], message: str) -> None:
    """Each argument is checked, and the error names it."""
    with pytest.raises(PathError) as caught:
        make()
    assert str(caught.value) == message
