"""Solids of flat faces."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.vehicles.bodies.shapes import (
    Faces,
    block,
    extrude,
    hull,
    loft,
    moved,
    normals,
    rod,
    section,
    shading,
)


def _volume(faces: Faces) -> float:
    """Return the volume by the divergence theorem: negative if faces look inwards."""
    corners = np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])
    cones = (corners[:, 0] * np.cross(corners[:, 1], corners[:, 2])).sum(axis=1)
    return float(cones.sum() / 6.0)


@pytest.mark.parametrize(
    ("faces", "volume"),
    [
        (block((-1.0, 0.0, 2.0), (0.0, 2.0, 5.0)), 6.0),
        (extrude([(0.0, 0.0), (2.0, 0.0), (0.0, 1.0)], -1.0, 2.0), 3.0),
        (loft([section(x, [(1.0, 0.0), (1.0, 0.5)]) for x in (0.0, 3.0)]), 3.0),
        (rod((0.0, 0.0, 1.0), (0.0, 0.0, 3.0), 1.0, 4), 4.0),
        (rod((0.0, 1.0, 0.0), (2.0, 1.0, 0.0), 1.0, 4), 4.0),
        (moved(block((0.0, 0.0, 0.0), (1.0, 2.0, 3.0)), (5.0, -4.0, 3.0), 1.2), 6.0),
    ],
)
def test_solids_are_closed_and_look_outwards(faces: Faces, volume: float) -> None:
    """The enclosed volume is that of the solid, and positive."""
    assert _volume(faces) == pytest.approx(volume)
    # The sum of the areas' vectors of a closed surface is 0.
    across = np.cross(faces[:, 2] - faces[:, 0], faces[:, 3] - faces[:, 1])
    np.testing.assert_allclose(across.sum(axis=0), 0.0, atol=1e-9)


def test_a_hull_has_its_length_width_and_a_pointed_bow() -> None:
    """It is widest amidships, its deck rises to the bow, and it ends in a stem ahead."""
    faces = hull(2.0, 0.6, 0.3)
    assert _volume(faces) > 0.6 * 2.0 * 0.6 * 0.3
    points = faces.reshape(-1, 3)
    np.testing.assert_allclose(points.min(axis=0), [-1.0, -0.3, 0.0], atol=1e-9)
    assert points.max(axis=0) == pytest.approx([1.0, 0.3, 0.375])
    stem = points[points[:, 0] > 0.99]
    assert np.abs(stem[:, 1]).max() < 0.01


def test_turning_is_counter_clockwise() -> None:
    """A quarter turn takes the x axis to the y axis."""
    faces = moved(block((0.0, 0.0, 0.0), (2.0, 0.1, 0.1)), (1.0, 1.0, 0.0), 0.5 * np.pi)
    np.testing.assert_allclose(faces.max(axis=(0, 1)), [1.0, 3.0, 0.1], atol=1e-12)


def test_the_top_is_brightest_and_the_bottom_darkest() -> None:
    """Brightness under an open sky falls from the top over the sides to the bottom."""
    faces = block((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    up, light = normals(faces)[:, 2], shading(faces)
    assert light[up > 0.9].min() == pytest.approx(1.0)
    sides = light[np.abs(up) < 0.1]
    assert light[up < -0.9].max() < sides.min() < sides.max() < 0.9
    assert len(set(sides.round(3))) == 4  # So that edges between them are visible.
