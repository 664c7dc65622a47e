"""One virtual camera for all vehicles: the horizon and the walls lie where they lie for others."""

from __future__ import annotations

import math
from contextlib import closing

import numpy as np
import pytest
from numpy.typing import NDArray

from shapechanger.bodies.vehicles import vehicle_model
from shapechanger.errors import WorldError
from shapechanger.worlds.rectify import CANONICAL_SIZE, CameraGeometry, Rectifier
from shapechanger.worlds.simulation import MujocoWorld
from shapechanger.worlds.world import Pose

_SIZE = (160, 120)


def _horizon(pitch_deg: float, fovy_deg: float) -> NDArray[np.uint8]:
    """A picture of a level camera's world: white above the horizon, black below."""
    wide, high = _SIZE
    focal = 0.5 * high / math.tan(math.radians(fovy_deg) / 2.0)
    row = 0.5 * high - focal * math.tan(math.radians(pitch_deg))
    picture = np.zeros((high, wide, 3), np.uint8)
    picture[: round(row)] = 255
    return picture


@pytest.mark.parametrize(
    ("pitch_deg", "fovy_deg"), [(0.0, 48.8), (3.0, 48.8), (-2.0, 48.8), (4.0, 60.0), (0.0, 90.0)]
)
def test_the_horizon_is_level(pitch_deg: float, fovy_deg: float) -> None:
    """However a camera is mounted, the horizon is in the same row."""
    seen = Rectifier(CameraGeometry(pitch_deg, fovy_deg), _SIZE)(_horizon(pitch_deg, fovy_deg))
    assert seen.shape == (CANONICAL_SIZE[1], CANONICAL_SIZE[0], 3)
    assert (seen[:21] == 255).all()
    assert (seen[23:] == 0).all()


@pytest.mark.gl
@pytest.mark.usefixtures("gl")
def test_rectified_pictures_of_vehicles_agree() -> None:
    """From one place, the tank's and the truck's pictures become nearly the car's."""
    raw: dict[str, NDArray[np.float64]] = {}
    rectified: dict[str, NDArray[np.float64]] = {}
    for vehicle in ("car", "tank", "truck"):
        mount = vehicle_model(vehicle).camera
        geometry = CameraGeometry(math.degrees(mount.pitch_rad), mount.fovy_deg)
        with closing(MujocoWorld(vehicle, "corridor", 11)) as world:
            start = world.pose
            # The lens of each at the same place.
            ahead = 0.12 - mount.x
            world.put(
                Pose(
                    start.x + ahead * math.cos(start.heading),
                    start.y + ahead * math.sin(start.heading),
                    start.heading,
                )
            )
            picture = world.picture()
        raw[vehicle] = picture.astype(np.float64)
        rectified[vehicle] = Rectifier(geometry, _SIZE)(picture).astype(np.float64)
    for vehicle in ("tank", "truck"):
        before = np.abs(raw[vehicle] - raw["car"]).mean()
        after = np.abs(rectified[vehicle] - rectified["car"]).mean()
        assert after < 0.6 * before


def test_a_camera_that_looks_elsewhere_is_refused() -> None:
    """A policy for all vehicles cannot see what the camera does not."""
    with pytest.raises(WorldError, match=r"looks 30 degrees down .* misses 60 %"):
        Rectifier(CameraGeometry(30.0, 48.8), _SIZE)
    with pytest.raises(WorldError, match="vertical field of view of 20 degrees misses"):
        Rectifier(CameraGeometry(0.0, 20.0), _SIZE)


def test_pictures_of_another_size_are_refused() -> None:
    """A place in a picture is a direction only if the size is known."""
    rectify = Rectifier(CameraGeometry(0.0, 48.8), _SIZE)
    with pytest.raises(WorldError, match=r"have the shape \(120, 160, 3\), got \(60, 80, 3\)"):
        rectify(np.zeros((60, 80, 3), np.uint8))
