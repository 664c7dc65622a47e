"""Closed lines of points."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.vehicles.courses.geometry import (
    length,
    normals,
    resample,
    smooth,
    tangent_radii,
    turn_angles,
)


def _ellipse(a: float, b: float, n: int) -> np.ndarray:
    angles = 2 * np.pi * np.arange(n) / n
    return np.stack([a * np.cos(angles), b * np.sin(angles)], axis=1)


def test_resampled_points_are_evenly_spaced() -> None:
    """Points are evenly spaced in sharp bends and from uneven input."""
    line = resample(_ellipse(6.0, 2.0, 2000), 0.1)
    chords = np.hypot(*np.diff(line, axis=0, append=line[:1]).T)
    assert chords == pytest.approx(chords[0], rel=1e-3)
    assert chords[0] == pytest.approx(0.1, rel=0.01)
    assert length(line) == pytest.approx(length(_ellipse(6.0, 2.0, 2000)), rel=1e-3)


def test_normals_point_left() -> None:
    """Normals of a counter-clockwise circle point inwards, and its turns sum to 2 pi."""
    circle = _ellipse(3.0, 3.0, 100)
    assert normals(circle) == pytest.approx(-circle / 3.0)
    assert turn_angles(circle).sum() == pytest.approx(2 * np.pi)
    assert turn_angles(circle[::-1]).sum() == pytest.approx(-2 * np.pi)


def test_tangent_radii_of_bends_and_necks() -> None:
    """They equal a circle's radius, and half the distance between two long sides."""
    assert tangent_radii(_ellipse(3.0, 3.0, 64)) == pytest.approx(3.0)
    x = np.linspace(-10.0, 10.0, 201)
    sides = np.concatenate([np.stack([x, 0 * x - 1], 1), np.stack([x[::-1], 0 * x + 1], 1)])
    assert tangent_radii(sides)[100] == pytest.approx(1.0)


def test_smoothing_keeps_the_middle_and_removes_wiggles() -> None:
    rng = np.random.default_rng(0)
    values = rng.normal(size=(100, 2))
    assert smooth(values, 4.0).mean(axis=0) == pytest.approx(values.mean(axis=0))
    wiggle = np.where(np.arange(100) % 2, 1.0, -1.0)
    assert smooth(wiggle, 4.0) == pytest.approx(0.0, abs=1e-9)
