"""A simulated vehicle on a course."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pytest

from shapechanger.contract.world import Pose
from shapechanger.errors import UnknownName, WorldError
from shapechanger.vehicles import world as world_module
from shapechanger.vehicles.bodies import SIM_DT, VEHICLES
from shapechanger.vehicles.bodies.parts import CameraJitter
from shapechanger.vehicles.courses.course import Look
from shapechanger.vehicles.world import MujocoWorld
from tests.vehicles.bodies.grounds import AHEAD

# Outputs for half the speed ahead.
_AHEAD = {name: {part: 0.5 * v for part, v in full.items()} for name, full in AHEAD.items()}
_EACH = pytest.mark.parametrize("vehicle", VEHICLES)


def _world(vehicle: str = "car", seed: int = 3) -> MujocoWorld:
    return MujocoWorld(vehicle, seed=seed, size=None)


def _drive(world: MujocoWorld, outputs: Mapping[str, float | None], seconds: float) -> None:
    for _ in range(round(seconds / 0.01)):
        world.advance(0.01, outputs)


@_EACH
def test_sleep_changes_no_drive(vehicle: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """With MuJoCo's sleep flag, states and geom poses of a drive into a wall are bit-identical."""
    states: list[tuple[bytes, ...]] = []
    world = _world(vehicle)
    assert world.model.opt.enableflags == mujoco.mjtEnableBit.mjENBL_SLEEP
    for flags in (mujoco.mjtEnableBit.mjENBL_SLEEP, 0):
        monkeypatch.setattr(world.model.opt, "enableflags", int(flags))
        world.put(_before_a_wall(world, 0.3))
        _drive(world, _AHEAD[vehicle], 2.0)
        assert world.collisions
        data = world.data
        states.append(tuple(x.tobytes() for x in (data.qpos, data.qvel, data.geom_xpos)))
        world.put(world.pose)
        _drive(world, {}, 30.0)  # Any other body sleeps after this time at rest.
        _drive(world, _AHEAD[vehicle], 0.1)
        states[-1] += (world.data.qpos.tobytes(),)
    assert states[0] == states[1]


@_EACH
def test_a_coarse_world_with_fine_steps_is_identical(
    vehicle: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Until the hull hits a wall, ignoring contacts of wheels with walls changes no pose."""
    monkeypatch.setattr(world_module, "_COARSE_DT", SIM_DT)
    poses: list[Pose] = []
    for coarse in (False, True):
        world = MujocoWorld(vehicle, seed=3, size=None, coarse=coarse)
        world.put(_before_a_wall(world, 1.0))
        for _ in range(600):
            if world.collisions:
                break
            poses.append(world.pose)
            world.advance(0.01, _AHEAD[vehicle])
        assert world.collisions == 1
    assert poses[: len(poses) // 2] == poses[len(poses) // 2 :]


def _before_a_wall(world: MujocoWorld, distance: float) -> Pose:
    """Return a pose that faces the middle of the longest wall at this distance."""
    ends = [np.array((wall.start, wall.end)) for wall in world.course.walls]
    start, end = max(ends, key=lambda wall: float(np.hypot(*(wall[1] - wall[0]))))
    along = (end - start) / np.hypot(*(end - start))
    x, y = (start + end) / 2.0 + distance * np.array((-along[1], along[0]))
    return Pose(float(x), float(y), math.atan2(-along[0], along[1]))


def test_advance_accepts_any_duration() -> None:
    """The remainder of a simulation step is added to the next call."""
    worlds = []
    for factor in (1.0 / 3.0, 1.0, 10.0):
        worlds.append(_world())
        for _ in range(round(100 / factor)):
            worlds[-1].advance(factor * SIM_DT, _AHEAD["car"])
    cut, steps, whole = worlds
    assert cut.pose == steps.pose
    assert math.dist((whole.pose.x, whole.pose.y), (steps.pose.x, steps.pose.y)) < 0.01
    assert cut.data.time == pytest.approx(100 * SIM_DT)


def test_put_back_after_a_collision() -> None:
    """A wall stops the car and presses its bumper; `put_back` keeps collisions and progress."""
    world = _world()
    world.put(_before_a_wall(world, 0.7))
    assert world.distance_m() == pytest.approx(0.7 - world.vehicle.nose_m, abs=0.005)
    _drive(world, _AHEAD["car"], 2.0)
    assert world.touches
    assert world.inputs().bumped
    assert world.inputs().speed == pytest.approx(0.0, abs=0.1)
    assert world.distance_m() == pytest.approx(0.0, abs=0.03)
    before, progress = world.pose, world.progress_m
    world.put_back()
    assert math.dist((world.pose.x, world.pose.y), (before.x, before.y)) < 2.0
    assert abs(world.progress_m - progress) < 2.0
    assert (world.collisions, world.inputs().speed) == (1, 0.0)
    progress = world.progress_m
    _drive(world, _AHEAD["car"], 0.6)
    assert not world.touches
    assert world.progress_m > progress + 0.05


@pytest.mark.parametrize(
    ("vehicle", "options", "error", "sentence"),
    [
        ("boat", {"world": "corridor"}, WorldError, "A boat floats: it cannot drive in a corridor"),
        ("car", {"world": "harbour"}, WorldError, "A car does not float: it cannot drive in a har"),
        ("tnak", {"world": "yard"}, UnknownName, "No vehicle matches 'tnak'. Did you mean 'tank'"),
        ("car", {"world": "yrad"}, UnknownName, "No world matches 'yrad'. Did you mean 'yard'"),
        ("car", {"lenses": ("nihgt",)}, UnknownName, "matches 'nihgt'. Did you mean 'night'"),
    ],
)
def test_unsuitable_worlds_and_unknown_names_are_refused(
    vehicle: str, options: dict[str, Any], error: type[Exception], sentence: str
) -> None:
    with pytest.raises(error, match=sentence):
        MujocoWorld(vehicle, size=None, **options)


def test_a_failed_layout_changes_nothing() -> None:
    world = _world()
    model, course, look = world.model, world.course, world.look
    with pytest.raises(WorldError, match="seed of a course must be at least 0"):
        world.lay_out(-1)
    dim = replace(look, light=0.3)
    with pytest.raises(WorldError, match="must be above the floor and on its vehicle"):
        world.lay_out(4, dim, CameraJitter(up_m=-1.0))
    assert (world.model, world.course, world.look) == (model, course, look)
    _drive(world, _AHEAD["car"], 0.2)


@pytest.mark.gl
@pytest.mark.usefixtures("gl")
def test_an_image_shows_the_course_and_its_light() -> None:
    with pytest.raises(WorldError, match="has no camera: pass a `size`"):
        _world().picture()
    world = MujocoWorld("car", seed=3, size=(64, 48))
    bright = world.picture()
    assert (bright.shape, bright.dtype) == ((48, 64, 3), np.uint8)
    assert bright.std() > 5.0
    world.lay_out(3, replace(Look.of("corridor"), light=0.2))
    assert world.picture().mean() < 0.8 * bright.mean()
    world.close()
