"""Looks of vehicles: they change no physics, and own cameras do not see what is for outside."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from shapechanger.vehicles.bodies import VEHICLES, add_vehicle
from shapechanger.vehicles.bodies.visuals import OUTSIDE_VIEW, OWN_VIEW, read_obj
from tests.vehicles.bodies.grounds import ALL

_MESH = int(mujoco.mjtGeom.mjGEOM_MESH)


def _spec(name: str) -> mujoco.MjSpec:
    spec = mujoco.MjSpec()
    add_vehicle(spec, name)
    return spec


@pytest.mark.parametrize("name", ALL)
def test_looks_have_no_mass_and_touch_nothing(name: str) -> None:
    """Without its visual geoms, masses, inertias and collision geoms are exactly the same."""
    model, bare = _spec(name).compile(), _spec(name)
    for geom in list(bare.geoms):
        if geom.group in (OWN_VIEW, OUTSIDE_VIEW):
            assert geom.contype == geom.conaffinity == 0
            assert geom.mass == 0.0
            bare.delete(geom)
    plain = bare.compile()
    for field in ("body_mass", "body_inertia", "body_ipos", "body_iquat", "dof_M0"):
        np.testing.assert_array_equal(getattr(model, field), getattr(plain, field), err_msg=field)
    solid = (model.geom_contype | model.geom_conaffinity) > 0
    assert solid.sum() == plain.ngeom
    for field in ("type", "size", "pos", "quat", "friction", "solref", "solimp", "contype",
                  "conaffinity", "bodyid", "priority"):  # fmt: skip
        mine, theirs = getattr(model, f"geom_{field}")[solid], getattr(plain, f"geom_{field}")
        np.testing.assert_array_equal(mine, theirs, err_msg=field)


@pytest.mark.parametrize("name", ALL)
def test_outside_a_vehicle_is_made_of_meshes(name: str) -> None:
    """What is seen from outside is meshes above the ground, or below it as their reflection."""
    model = _spec(name).compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    seen = np.flatnonzero(model.geom_group == OUTSIDE_VIEW)
    assert len(seen) >= 8
    assert (model.geom_type[seen] == _MESH).all()
    heights: list[float] = []
    for i in seen:
        mesh = model.geom_dataid[i]
        if model.mesh(mesh).name.endswith("/shadow"):
            continue
        first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        turn = data.geom_xmat[i].reshape(3, 3)
        points = model.mesh_vert[first : first + count] @ turn.T + data.geom_xpos[i]
        assert np.abs(points[:, 1]).max() <= 0.5 * VEHICLES[name].width_m + 0.015  # With mirrors.
        heights += list(points[:, 2])
    assert max(heights) == pytest.approx(-min(heights), abs=1e-4)


_CUBE = """# A cube, its top as two triangles.
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 0 0 1
v 1 0 1
v 1 1 1
v 0 1 1
vt 0.25 0.5
o cube
usemtl side
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f 4 1 5 8
usemtl top
f 5/1 6/1 7/1
f 5/1 7/1 8/1
o floor
usemtl side
f 4 3 2 1
"""


def test_meshes_are_read_by_object_and_material(tmp_path: Path) -> None:
    """The last corner of a triangle is there twice; texture coordinates belong to corners."""
    path = tmp_path / "cube.obj"
    path.write_text(_CUBE)
    objects = read_obj(path)
    assert list(objects) == ["cube", "floor"]
    assert list(objects["cube"]) == ["side", "top"]
    faces, uvs = objects["cube"]["top"]
    np.testing.assert_array_equal(faces[0], [(0, 0, 1), (1, 0, 1), (1, 1, 1), (1, 1, 1)])
    np.testing.assert_array_equal(uvs, np.full((2, 4, 2), (0.25, 0.5)))
