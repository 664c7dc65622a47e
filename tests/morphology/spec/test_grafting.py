"""Copying and moving of limbs, with assets and many kinds of references."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.errors import MorphologyError
from shapechanger.morphology import AddLimb, Split
from shapechanger.morphology.spec.grafting import copy_element, copy_limb
from tests.morphology.models import built, spec_of
from tests.morphology.scenes import EVERYTHING

_WITH_ASSETS = """
<mujoco>
  <compiler angle="radian"/>
  <asset>
    <mesh name="wedge" vertex="0 0 0  0.1 0 0  0 0.1 0  0 0 0.1"/>
    <texture name="plain" type="2d" builtin="flat" rgb1="1 0 0" width="4" height="4"/>
    <material name="red" texture="plain"/>
  </asset>
  <default><default class="leg"><geom density="500"/><joint damping="3"/></default></default>
  <worldbody>
    <body name="trunk" pos="0 0 1"><freejoint name="root"/>
      <geom name="trunk" type="box" size=".2 .1 .05"/>
      <body name="thigh" pos="0 .2 0" childclass="leg">
        <joint name="hip" axis="1 0 0" range="-1 1"/>
        <geom name="thigh" type="capsule" fromto="0 0 0 0 .3 0" size=".03" material="red"/>
        <body name="shin" pos="0 .3 0">
          <joint name="knee" axis="1 0 0" range="-1 1"/>
          <geom name="shin" type="capsule" fromto="0 0 0 0 .3 0" size=".03" material="red"/>
          <geom name="horn" type="mesh" mesh="wedge" mass=".1"/>
          <site name="tip" pos="0 .3 0" material="red"/>
          <camera name="eye"/><light name="lamp"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def test_a_copied_limb_shares_the_assets() -> None:
    spec = spec_of(_WITH_ASSETS)
    before = built(spec)
    for suffix, angle in (("_2", 2.0), ("_3", 4.0)):
        copy = copy_limb(spec, spec.body("thigh"), suffix, angle)
        assert copy.name == f"thigh{suffix}"
    after = built(spec)
    assert (after.nmesh, after.nmat, after.ntex) == (before.nmesh, before.nmat, before.ntex)
    assert after.geom("shin_3").matid == after.site("tip_2").matid == after.material("red").id
    assert after.geom("horn_2").dataid == after.geom("horn").dataid
    np.testing.assert_array_equal(after.body("shin_2").inertia, before.body("shin").inertia)
    assert after.joint("knee_3").damping[0] == 3.0
    assert after.camera("eye_2").bodyid == after.body("shin_2").id
    assert after.light("lamp_2").bodyid == after.body("shin_2").id


def test_limbs_of_a_complex_model_can_be_copied() -> None:
    """Height fields, skyboxes, mocap bodies, ball joints and muscles are supported."""
    before, spec = built(spec_of(EVERYTHING)), spec_of(EVERYTHING)
    with pytest.raises(MorphologyError, match="'knee' follows 'wrist', and cannot follow a copy"):
        built(spec, AddLimb("arm", "_2", 2.0))
    spec.delete(spec.equality("mirror"))
    with pytest.raises(MorphologyError, match="'hand' cannot be split: the actuator 'suction'"):
        built(spec, Split("hand", "finger"))
    spec.delete(spec.actuator("suction"))
    model = built(spec, AddLimb("arm", "_2", 2.0), Split("hand", "finger"))
    assert (model.nbody, model.nmesh, model.nhfield) == (
        before.nbody + 3,
        before.nmesh,
        before.nhfield,
    )


def test_a_copied_geom_equals_the_original() -> None:
    spec = spec_of(
        """<mujoco><asset><material name="red"/></asset><worldbody>
        <body name="a"><freejoint/><geom name="a" type="ellipsoid" size=".1 .2 .3" pos="1 2 3"
        euler="10 20 30" density="7" contype="2" conaffinity="4" condim="6" priority="3"
        friction=".1 .2 .3" solmix=".4" solref=".03 .5" solimp=".8 .9 .01 .4 3" margin=".01"
        gap=".005" group="3" rgba=".1 .2 .3 .4" material="red" fluidshape="ellipsoid"
        fluidcoef=".6 .3 1.6 1.1 1.2"/></body>
        <body name="b"><freejoint/></body></worldbody></mujoco>"""
    )
    copy_element(spec, spec.geom("a"), spec.body("b"), "b")
    model = built(spec)
    for field in [name for name in dir(model) if name.startswith("geom_")]:
        if field not in ("geom_bodyid",):
            first, second = getattr(model, field)
            np.testing.assert_array_equal(second, first, err_msg=field)
    np.testing.assert_array_equal(model.body("b").inertia, model.body("a").inertia)
    with pytest.raises(MorphologyError, match="A new geom needs an unused name"):
        copy_element(spec, spec.geom("a"), spec.body("b"), "b")
