"""Edits that place one body, geom or floor, and that set the total mass."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from shapechanger.morphology import (
    AddFloor,
    AddFreeJoint,
    Mass,
    PlaceBody,
    PlaceGeom,
    StartHeight,
    TotalMass,
    compile_body,
)
from tests.morphology.models import (
    URDF,
    ant,
    built,
    capsule_inertia,
    capsule_mass,
    leg,
    limb,
    spec_of,
    tip,
)


def test_a_body_moves_with_what_it_carries() -> None:
    """Joints, geoms, sites and children keep their places relative to the body."""
    before, after = built(leg()), built(leg(), PlaceBody("thigh", (0.0, 0.5, 0.1)))
    np.testing.assert_array_equal(after.body("thigh").pos, [0.0, 0.5, 0.1])
    for field in ("geom_pos", "jnt_pos", "site_pos", "body_mass", "body_inertia", "body_ipos"):
        np.testing.assert_array_equal(getattr(after, field), getattr(before, field))
    np.testing.assert_allclose(tip(after, "toe") - tip(before, "toe"), [0.0, 0.3, 0.1])


def test_a_geom_is_placed_by_its_ends() -> None:
    """The body's mass and inertia follow, and nothing else moves."""
    edit = PlaceGeom("thigh", (0.0, 0.0, 0.1), (0.0, 0.3, -0.3), radius=0.05)
    before, after = built(leg()), built(leg(), edit)
    assert after.geom("thigh").size[:2] == pytest.approx([0.05, 0.25])
    np.testing.assert_allclose(after.geom("thigh").pos, [0.0, 0.15, -0.1])
    across, along = capsule_inertia(0.05, 0.5, 500.0)
    assert after.body("thigh").mass == pytest.approx(capsule_mass(0.05, 0.5, 500.0))
    np.testing.assert_allclose(sorted(after.body("thigh").inertia), sorted([across, across, along]))
    for site in ("scar", "knee_cap", "toe"):
        np.testing.assert_array_equal(tip(after, site), tip(before, site))


@pytest.mark.parametrize("ends", [(0.1, 0.9), (0.9, 0.1)])
def test_halfway_lies_between(ends: tuple[float, float]) -> None:
    """The ends of a geom given by its pose have no order: each goes to the nearer new one."""
    model = limb('<geom name="rod" type="capsule" size=".1 .2" pos="0 0 .3"/>')
    start, end = ((0.0, 0.0, height) for height in ends)
    whole = built(model, PlaceGeom("rod", start, end))
    assert whole.geom("rod").size[1] == pytest.approx(0.4)
    half = built(model, PlaceGeom("rod", start, end, amount=0.5))
    assert half.geom("rod").size[1] == pytest.approx(0.3)
    assert half.geom("rod").pos[2] == pytest.approx(0.4)


def test_a_geom_is_moved_by_its_middle() -> None:
    """Whatever its shape, and halfway at half the amount; its axes keep their directions."""
    before = built(leg())
    for geom in ("sole", "shin", "trunk"):
        after = built(leg(), PlaceGeom(geom, middle=(0.0, 0.1, 0.2)))
        np.testing.assert_allclose(after.geom(geom).pos, [0.0, 0.1, 0.2], atol=1e-15)
        np.testing.assert_array_equal(after.geom(geom).quat, before.geom(geom).quat)
        half = built(leg(), PlaceGeom(geom, middle=(0.0, 0.1, 0.2), amount=0.5))
        np.testing.assert_allclose(
            half.geom(geom).pos,
            0.5 * (before.geom(geom).pos + np.array([0.0, 0.1, 0.2])),
            atol=1e-15,
        )


def test_the_total_mass_is_set() -> None:
    """After other edits, with the inertia in proportion; halfway at half the amount."""
    before = built(ant(), Mass("torso", scale=3.0))
    after = built(ant(), Mass("torso", scale=3.0), TotalMass(14.0))
    assert after.body_mass.sum() == pytest.approx(14.0, rel=1e-12)
    factor = 14.0 / before.body_mass.sum()
    np.testing.assert_allclose(after.body_inertia, factor * before.body_inertia, rtol=1e-9)
    half = built(ant(), Mass("torso", scale=3.0), TotalMass(14.0, amount=0.5))
    assert half.body_mass.sum() == pytest.approx(0.5 * (14.0 + before.body_mass.sum()))


def test_a_robot_lands_on_its_floor() -> None:
    """The box of 0.2 m comes to rest 0.1 m above it."""
    body = (AddFreeJoint("base"), StartHeight("base", 0.7), AddFloor(friction=0.5, height=0.5))
    model = compile_body(spec_of(URDF), body)
    assert model.geom("floor").friction[0] == 0.5
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=500)
    assert data.qpos[2] == pytest.approx(0.6, abs=0.01)
