"""Meshes of walls: light and texture."""

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


def test_light_varies_along_a_long_wall() -> None:
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
