"""Meshes of walls: splitting, light and texture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shapechanger.vehicles.courses.course import Course, Lamp, Look, Wall
from shapechanger.vehicles.courses.surfaces import Surfaces
from tests.vehicles.courses.scenes import square, with_walls


def pieces(course: Course, surface: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return corners (n, 4, 3), texture coordinates (n, 4, 2) and lights (n, 4) of a surface."""
    mesh = Surfaces(course, Look.of(course.world)).walls()[surface]
    points, uvs, lights, _ = mesh.arrays(mirrored=False)
    return points.reshape(-1, 4, 3), uvs.reshape(-1, 4, 2), lights.reshape(-1, 4)


@pytest.mark.parametrize(
    ("length", "columns"), [(0.3, 1), (0.8, 1), (0.81, 2), (1.6, 2), (2.0, 3), (7.9, 10)]
)
def test_long_walls_are_split(length: float, columns: int) -> None:
    """Walls are split into equal quads of at most 0.8 m in two rows."""
    wall = Wall((1.0, 2.0), (1.0 + length, 2.0), 2.0, "brick")
    corners, _, _ = pieces(with_walls(square("corridor"), wall), "brick")
    assert len(corners) == 2 * columns
    widths = np.ptp(corners[..., 0], axis=1)
    np.testing.assert_allclose(widths, length / columns)
    assert widths.max() <= 0.8 + 1e-9
    heights = np.ptp(corners[..., 2], axis=1)
    assert (widths * heights).sum() == pytest.approx(length * 2.0)
    assert set(np.round(corners[..., 2].ravel(), 6)) == {0.0, 0.7, 2.0}
    assert corners[..., 0].min() == pytest.approx(1.0)
    assert corners[..., 0].max() == pytest.approx(1.0 + length)
    np.testing.assert_allclose(corners[..., 1], 2.0)


def test_texture_coordinates_are_continuous() -> None:
    wall = Wall((0.0, 0.0), (6.0, 0.0), 0.9, "brick")
    corners, uvs, _ = pieces(with_walls(square("corridor"), wall), "brick")
    u = (6.0 - corners[..., 0]) / 1.2
    np.testing.assert_allclose(uvs[..., 0], u, atol=1e-9)
    v = (0.9 - corners[..., 2]) / 1.8
    np.testing.assert_allclose(uvs[..., 1], v, atol=1e-9)


def test_light_varies_along_a_long_wall() -> None:
    """Light is brightest below a lamp and symmetric around it."""
    wall = Wall((0.0, 0.0), (8.0, 0.0), 2.0, "brick")
    course = with_walls(square("corridor"), wall)
    course = replace(course, lamps=(Lamp(4.0, 0.5, 0.0, 1.2, 0.3),))
    corners, _, lights = pieces(course, "brick")
    middle = np.abs(corners[..., 2] - 0.7) < 1e-9
    x, light = corners[..., 0][middle], lights[middle]
    assert x[light.argmax()] == pytest.approx(4.0)
    assert light.max() > 1.5 * light[np.abs(x - 4.0) > 3.9].max()
    for at, value in zip(x, light, strict=True):
        np.testing.assert_allclose(light[np.abs(x - (8.0 - at)) < 1e-6], value)


def test_a_door_is_one_texture_with_plaster_above() -> None:
    door = Wall((0.0, 0.0), (1.02, 0.0), 2.5, "door")
    course = with_walls(square("corridor"), door)
    corners, uvs, _ = pieces(course, "door")
    assert corners[..., 2].max() == pytest.approx(2.1)
    assert (uvs[..., 0].min(), uvs[..., 0].max()) == (0.0, 1.0)
    assert (uvs[..., 1].min(), uvs[..., 1].max()) == (0.0, 1.0)
    above, _, _ = pieces(course, "plaster")
    assert above[..., 2].min() == pytest.approx(2.1)
    assert above[..., 2].max() == pytest.approx(2.5)
