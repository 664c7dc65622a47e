"""Views of a vehicle in its world from outside."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest
from numpy.typing import NDArray

from shapechanger.errors import RenderError
from shapechanger.vehicles.bodies.visuals import OUTSIDE_VIEW
from shapechanger.vehicles.courses.course import HOME
from shapechanger.vehicles.envs import WaypointEnv
from shapechanger.vehicles.world import PORTRAITS_RAD, MujocoWorld

pytestmark = [pytest.mark.gl, pytest.mark.usefixtures("gl")]


@contextmanager
def _invisible(world: MujocoWorld) -> Iterator[None]:
    """Hide the vehicle in outside views; the model is shared, so it is restored."""
    model = world.model
    hidden = model.geom_group == OUTSIDE_VIEW
    model.geom_group[hidden] = 5
    try:
        yield
    finally:
        model.geom_group[hidden] = OUTSIDE_VIEW


def _changed(one: NDArray[np.uint8], other: NDArray[np.uint8]) -> NDArray[np.bool_]:
    return np.abs(one.astype(int) - other).max(axis=2) > 3


@pytest.mark.parametrize("vehicle", HOME)
def test_the_outside_view_shows_the_vehicle_in_its_world(vehicle: str) -> None:
    """The vehicle is in the middle, smaller with a larger reach, on ground with a texture."""
    world = MujocoWorld(vehicle, size=None)
    near, far = world.outside(160, 120), world.outside(160, 120, 3.0 * world.reach)
    with _invisible(world):
        empty, distant = world.outside(160, 120), world.outside(160, 120, 3.0 * world.reach)
    world.close()
    assert near.shape == (120, 160, 3)
    shown, small = _changed(near, empty), _changed(far, distant)
    assert 0.1 < shown.mean() < 0.6
    assert shown.mean() > 4 * small.mean() > 0.0
    rows, columns = np.nonzero(shown)
    assert abs(columns.mean() - 80.0) < 16.0
    assert abs(rows.mean() - 60.0) < 16.0
    assert empty[80:].std(axis=(0, 1)).max() > 4.0  # The ground has a texture.


@pytest.mark.parametrize("vehicle", HOME)
def test_the_onboard_camera_does_not_see_the_vehicle(vehicle: str) -> None:
    """Geoms for outside views, and rendering such views, do not change the camera's image."""
    world = MujocoWorld(vehicle, size=(160, 120))
    before = world.picture()
    world.outside(160, 120)
    np.testing.assert_array_equal(world.picture(), before)
    with _invisible(world):
        np.testing.assert_array_equal(world.picture(), before)
    world.close()


@pytest.mark.parametrize("size", [(0, 48), (7, -3), (64, 5000)])
def test_a_size_out_of_range_is_refused(size: tuple[int, int]) -> None:
    world = MujocoWorld("car", size=None)
    limit = "at least 1 x 1 pixels" if min(size) < 1 else "at most 4096 pixels a side"
    with pytest.raises(RenderError, match=f"{limit}, got {size[0]} x {size[1]}"):
        world.outside(*size)
    world.close()


def test_no_wall_hides_the_vehicle() -> None:
    """Pillars are between the vehicle and the first two views, so the third is chosen."""
    env = WaypointEnv("car")
    env.reset(seed=0)
    views = [env.world.outside(160, 120, 0.4, azimuth_rad=each) for each in PORTRAITS_RAD[:3]]
    chosen = env.world.outside(160, 120, 0.4)
    env.close()
    assert [np.array_equal(chosen, view) for view in views] == [False, False, True]
