"""Rectified images, and measuring a camera."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from shapechanger.errors import WorldError
from shapechanger.vehicles.cameras.rectify import (
    CANONICAL_SIZE,
    CameraGeometry,
    Rectifier,
    draw_view,
    measure_camera,
    pitch_of_horizon,
)

_SIZE = (160, 120)
_GREY = np.full((120, 160, 3), 90, np.uint8)


def _rectifier(pitch_deg: float, fovy_deg: float) -> Rectifier:
    return Rectifier(CameraGeometry(pitch_deg, fovy_deg), _SIZE)


def _horizon(pitch_deg: float, fovy_deg: float) -> NDArray[np.uint8]:
    """Return an image that is white above the horizon and black below."""
    wide, high = _SIZE
    focal = 0.5 * high / math.tan(math.radians(fovy_deg) / 2.0)
    row = 0.5 * high - focal * math.tan(math.radians(pitch_deg))
    picture = np.zeros((high, wide, 3), np.uint8)
    picture[: round(row)] = 255
    return picture


@pytest.mark.parametrize(
    ("pitch_deg", "fovy_deg"), [(0.0, 48.8), (3.0, 48.8), (-2.0, 48.8), (4.0, 60.0), (0.0, 90.0)]
)
def test_the_horizon_is_in_the_same_row_for_all_mounts(pitch_deg: float, fovy_deg: float) -> None:
    seen = _rectifier(pitch_deg, fovy_deg)(_horizon(pitch_deg, fovy_deg))
    assert seen.shape == (CANONICAL_SIZE[1], CANONICAL_SIZE[0], 3)
    assert (seen[:21] == 255).all()
    assert (seen[23:] == 0).all()


@pytest.mark.parametrize(
    ("refused", "text"),
    [
        (lambda: _rectifier(30.0, 48.8), r"looks 30 degrees down .* misses 60 %"),
        (lambda: _rectifier(0.0, 20.0), "vertical field of view of 20 degrees misses"),
        (lambda: _rectifier(0.0, 48.8)(_GREY[::2]), r"shape \(120, 160, 3\), got \(60, 160, 3\)"),
        (lambda: measure_camera(_GREY, (7, 5)), "no checkerboard of 7 x 5 inner corners"),
        (lambda: measure_camera(_GREY, (7, 2)), "at least 3 inner corners"),
        (lambda: pitch_of_horizon(121.0, 120, 48.8), "from 0 to 120"),
    ],
    ids=["down", "narrow", "size", "no board", "small board", "horizon"],
)
def test_unsuitable_images_and_cameras_are_refused(
    refused: Callable[[], object], text: str
) -> None:
    with pytest.raises(WorldError, match=text):
        refused()


def board_picture(
    pitch_deg: float, fovy_deg: float, turned_deg: float, roll_deg: float = 0.0
) -> NDArray[np.uint8]:
    """Draw an upright board of 7 x 5 inner corners, 12 squares away, with noise."""
    wide, high = 320, 240
    focal = 0.5 * high / math.tan(0.5 * math.radians(fovy_deg))
    x, y = np.meshgrid(np.arange(0.25, wide, 0.5), np.arange(0.25, high, 0.5))
    rays = np.stack((x - 0.5 * wide, y - 0.5 * high, np.full_like(x, focal)), axis=-1)
    level = Rotation.from_euler("xz", (-pitch_deg, roll_deg), degrees=True).as_matrix()
    board = Rotation.from_euler("y", turned_deg, degrees=True).as_matrix()
    rays = rays @ level.T
    middle = np.array((0.4, 0.8, 12.0))
    places = rays * (middle @ board[:, 2] / (rays @ board[:, 2]))[..., None] - middle
    across, down = places @ board[:, 0] + 4.0, places @ board[:, 1] + 3.0
    dark = np.where((np.floor(across) + np.floor(down)) % 2 < 1, 30.0, 220.0)
    paper = (across > -1.0) & (across < 9.0) & (down > -1.0) & (down < 7.0)
    inside = (across > 0.0) & (across < 8.0) & (down > 0.0) & (down < 6.0)
    fine = np.where(inside, dark, np.where(paper, 230.0, 110.0))
    grey = fine.reshape(high, 2, wide, 2).mean(axis=(1, 3))
    grey += np.random.default_rng(0).normal(0.0, 4.0, grey.shape)
    return np.repeat(np.clip(grey, 0.0, 255.0).astype(np.uint8)[..., None], 3, axis=2)


@pytest.mark.parametrize(
    ("pitch_deg", "fovy_deg", "turned_deg", "roll_deg"),
    [(0.0, 48.8, 35.0, 0.0), (4.0, 48.8, -35.0, 2.0), (-6.0, 62.0, 40.0, 0.0)],
)
def test_a_board_gives_pitch_and_field_of_view(
    pitch_deg: float, fovy_deg: float, turned_deg: float, roll_deg: float
) -> None:
    found = measure_camera(board_picture(pitch_deg, fovy_deg, turned_deg, roll_deg), (7, 5))
    assert found.geometry.pitch_deg == pytest.approx(pitch_deg, abs=0.15)
    assert found.geometry.fovy_deg == pytest.approx(fovy_deg, abs=0.5)
    assert found.roll_deg == pytest.approx(roll_deg, abs=0.15)
    assert found.error_px < 0.2
    assert abs(found.geometry.pitch_deg - pitch_deg) < 4.0 * found.pitch_sd_deg
    assert abs(found.geometry.fovy_deg - fovy_deg) < 4.0 * found.fovy_sd_deg


def test_a_board_that_faces_the_camera_needs_the_field_of_view() -> None:
    picture = board_picture(3.0, 48.8, 0.0)
    with pytest.raises(WorldError, match="field of view"):
        measure_camera(picture, (7, 5))
    found = measure_camera(picture, (7, 5), fovy_deg=48.8)
    assert found.geometry.pitch_deg == pytest.approx(3.0, abs=0.3)
    assert found.fovy_sd_deg == 0.0


@pytest.mark.parametrize(("pitch_deg", "fovy_deg"), [(0.0, 48.8), (5.0, 48.8), (-3.0, 62.0)])
def test_a_horizon_gives_the_pitch(pitch_deg: float, fovy_deg: float) -> None:
    row = float((_horizon(pitch_deg, fovy_deg)[:, 0, 0] == 255).sum())
    assert pitch_of_horizon(row, _SIZE[1], fovy_deg) == pytest.approx(pitch_deg, abs=0.3)


def test_the_drawing_shows_the_horizon() -> None:
    geometry = CameraGeometry(3.0, 48.8)
    picture = _horizon(3.0, 48.8)
    drawn = draw_view(picture, geometry)
    changed = (drawn != picture).any(axis=-1)
    row = int((picture[:, 0, 0] == 255).sum())
    assert changed[row - 1 : row + 1, 10:-10].any(axis=0).mean() > 0.1
    assert changed.mean() < 0.1
