"""Looks of vehicles: they change no physics."""

import mujoco
import numpy as np
import pytest

from shapechanger.vehicles.bodies import add_vehicle
from shapechanger.vehicles.bodies.visuals import OUTSIDE_VIEW, OWN_VIEW
from tests.vehicles.bodies.grounds import ALL


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
