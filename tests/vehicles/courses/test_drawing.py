"""Rendered images of courses."""

from collections.abc import Iterator
from dataclasses import replace
from types import MappingProxyType

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from shapechanger.vehicles.cameras.camera import OnboardCamera
from shapechanger.vehicles.courses import textures
from shapechanger.vehicles.courses.course import Course, Look, Wall
from shapechanger.vehicles.courses.scene import add_course
from tests.vehicles.courses.scenes import square, with_walls

pytestmark = [pytest.mark.gl, pytest.mark.usefixtures("gl")]

_WHITE = Look(light=1.0, warmth=0.0, contrast=0.0, gloss=0.0)
_WIDTH, _HEIGHT = 160, 120


def _draw(
    course: Course, look: Look, place: tuple[float, float], angle: float
) -> NDArray[np.uint8]:
    """Render the view at `place`, 0.5 m above the ground, along `angle`, rad."""
    spec = mujoco.MjSpec()
    add_course(spec, course, look)
    cos, sin = float(np.cos(angle)), float(np.sin(angle))
    spec.worldbody.add_camera(
        name="eye", pos=[*place, 0.5], xyaxes=[sin, -cos, 0.0, 0.0, 0.0, 1.0], fovy=66.0
    )
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    camera = OnboardCamera((_WIDTH, _HEIGHT), "eye")
    try:
        return camera.picture(model, data)
    finally:
        camera.close()


@pytest.fixture
def quarters(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Texture that is green at the top left, red at the top right and blue below."""

    def painted(rng: np.random.Generator) -> NDArray[np.float32]:
        del rng
        image = np.zeros((64, 64, 3), np.float32)
        image[:32, :32, 1] = image[:32, 32:, 0] = image[32:, :, 2] = 1.0
        return image

    monkeypatch.setattr(
        textures, "PAINTERS", MappingProxyType({**textures.PAINTERS, "window": painted})
    )
    textures.texture.cache_clear()
    yield
    textures.texture.cache_clear()


@pytest.mark.usefixtures("quarters")
@pytest.mark.parametrize("angle", [0.0, 0.5 * np.pi, np.pi, -0.5 * np.pi])
def test_a_texture_is_upright_and_not_mirrored(angle: float) -> None:
    ahead = np.array([np.cos(angle), np.sin(angle)])
    right = np.array([ahead[1], -ahead[0]])
    # A wall 1.8 m wide, 1 m ahead; its visible side is on the left of its direction.
    start, end = ahead + 0.9 * right, ahead - 0.9 * right
    wall = Wall((start[0], start[1]), (end[0], end[1]), 1.0, "window")
    picture = _draw(with_walls(square("corridor"), wall), _WHITE, (0.0, 0.0), angle)
    top, bottom = _HEIGHT // 2 - 20, _HEIGHT // 2 + 20
    left, right_hand = _WIDTH // 2 - 30, _WIDTH // 2 + 30
    assert picture[top, left].argmax() == 1
    assert picture[top, right_hand].argmax() == 0
    assert picture[bottom, left].argmax() == picture[bottom, right_hand].argmax() == 2


def test_a_glossy_floor_reflects_lamps() -> None:
    course = square("corridor")
    dull, glossy = (
        _draw(course, replace(Look.of("corridor"), gloss=gloss), (-0.5, 0.0), 0.0)
        for gloss in (0.0, 0.6)
    )
    # In this yellow light, only the lamp is white.
    below = slice(_HEIGHT // 2, None)
    assert glossy[below, :, 2].max() > 1.5 * dull[below, :, 2].max()
