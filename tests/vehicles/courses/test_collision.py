"""Collision geoms of a course."""

import mujoco
import pytest

from shapechanger.vehicles.courses.course import Look
from shapechanger.vehicles.courses.scene import add_course
from tests.vehicles.courses.scenes import square

_WORLDS = ("corridor", "yard", "harbour")
# Collision bits of a vehicle's hull and wheels.
_HULL = {"contype": 2, "conaffinity": 1}
_WHEEL = {"contype": 10, "conaffinity": 5}


def _compiled(world: str, contype: int = 0, conaffinity: int = 0) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    add_course(spec, square(world), Look.of(world))
    if contype:
        body = spec.worldbody.add_body(name="ball")
        body.add_freejoint()
        body.add_geom(name="ball", size=[0.1, 0.0, 0.0], contype=contype, conaffinity=conaffinity)
    return spec.compile()


def _touched(model: mujoco.MjModel, *place: float) -> set[str]:
    data = mujoco.MjData(model)
    data.qpos[:3] = place
    mujoco.mj_forward(model, data)
    names = {model.geom(number).name for contact in data.contact for number in contact.geom}
    return names - {"ball"}


@pytest.mark.parametrize("world", _WORLDS)
def test_collision_and_visual_geoms_are_separate(world: str) -> None:
    model = _compiled(world)
    touchable = (model.geom_contype | model.geom_conaffinity) > 0
    assert (model.geom_group[touchable] == 3).all()
    assert (model.geom_group[~touchable] == 0).all()
    assert (model.geom_type[~touchable] == mujoco.mjtGeom.mjGEOM_MESH).all()


@pytest.mark.parametrize(("bits", "ground"), [(_HULL, False), (_WHEEL, True)])
def test_only_wheels_collide_with_the_ground(bits: dict[str, int], ground: bool) -> None:
    touched = _touched(_compiled("corridor", **bits), 0.0, 3.0, 0.05)
    assert touched == ({"world/ground"} if ground else set())


@pytest.mark.parametrize("bits", [_HULL, _WHEEL])
def test_hulls_and_wheels_touch_walls_and_obstacles(bits: dict[str, int]) -> None:
    model = _compiled("corridor", **bits)
    assert _touched(model, 3.5, -0.95, 0.3) == {"world/wall/0"}
    assert _touched(model, 6.6, 2.8, 0.3) == {"world/thing/1"}


def test_the_visible_side_of_a_wall_is_its_collision_surface() -> None:
    model = _compiled("corridor", **_HULL)
    assert _touched(model, 3.5, -0.89, 0.3) == set()
    assert _touched(model, 3.5, -0.91, 0.3) == {"world/wall/0"}
