"""Segments: anchors, far ends, and children that move along."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from shapechanger.errors import MorphologyError
from shapechanger.morphology import Cut, Radius, Stretch
from shapechanger.morphology.spec.explicit import make_explicit
from shapechanger.morphology.spec.geometry import (
    anchor,
    far_end,
    held_at,
    require_geometry,
    resize_limb,
    scale_mass,
)
from tests.morphology.models import built, gantry, leg, limb, mass, spec_of
from tests.morphology.scenes import asset_spec

_MESH = """
<mujoco>
  <asset>
    <mesh name="wedge" vertex="0 0 0  0.1 0 0  0 0.1 0  0 0 0.1"/>
    <hfield name="hill" nrow="2" ncol="2" size="1 1 .1 .1"/>
  </asset>
  <worldbody>
    <body name="trunk"><geom name="trunk" size=".1"/>
      <body name="link" pos="0 0 1"><joint name="link"/>
        <geom name="horn" type="mesh" mesh="wedge"/>
        <geom type="capsule" size=".1 .2"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
_WRITTEN_OUT = """
<inertial pos=".1 0 0" mass="2" diaginertia=".1 .2 .25"/>
<geom name="link" type="capsule" size=".1 .2"/>
"""


def test_the_anchor_is_the_first_rotating_joint() -> None:
    """Positions of slides are ignored."""
    hopper = asset_spec("hopper")
    np.testing.assert_array_equal(anchor(hopper.body("torso")), [0.0, 0.0, 0.0])
    np.testing.assert_array_equal(anchor(hopper.body("leg")), [0.0, 0.0, 0.25])
    np.testing.assert_array_equal(anchor(gantry().body("rig")), [0.3, 0.1, 0.0])
    np.testing.assert_array_equal(anchor(leg().body("trunk")), [0.0, 0.0, 0.0])


def test_the_hopper_stretches_in_place() -> None:
    """The torso does not rise, although its root slides are defined at the floor."""
    model = built(asset_spec("hopper"), Stretch("torso", 1.5))
    np.testing.assert_array_equal(model.geom("torso_geom").pos, [0.0, 0.0, 0.0])
    np.testing.assert_allclose(model.body("thigh").pos, [0.0, 0.0, -0.3])


def test_the_anchor_in_the_parents_frame() -> None:
    """The pose of the body is applied."""
    spec = gantry()
    model = built(spec)
    make_explicit(spec)
    body, joint = model.body("boom"), model.joint("swing")
    turned = np.empty(3)
    mujoco.mju_rotVecQuat(turned, joint.pos, body.quat)
    np.testing.assert_allclose(held_at(spec.body("boom")), body.pos + turned, atol=1e-12)


def test_the_far_end_is_the_end_of_an_axis() -> None:
    """It is the end farther from the anchor; spheres have none."""
    spec = leg()
    np.testing.assert_allclose(far_end(spec.body("shin")), [0.0, 0.0, -0.25])
    with pytest.raises(MorphologyError, match="'trunk' has no capsule or cylinder, so it has no"):
        far_end(spec.body("trunk"))


def test_children_move_along_with_a_stretch() -> None:
    """Bodies move by their anchors, sites and further joints by their positions."""
    model = built(leg(), Stretch("thigh", 2.0))
    np.testing.assert_allclose(model.site("scar").pos, [0.0, 0.0, -0.12])
    # The knee, 5 cm below the shin's origin, stays at the end of the thigh.
    np.testing.assert_allclose(model.body("shin").pos + model.joint("knee").pos, [0.0, 0.0, -0.6])
    np.testing.assert_array_equal(model.joint("knee").pos, [0.0, 0.0, -0.05])
    rig = built(gantry(), Stretch("rig", 2.0))
    held = np.array([0.3, 0.1, 0.0])
    np.testing.assert_allclose(rig.joint("yaw").pos, held)
    np.testing.assert_allclose(rig.joint("pitch").pos, held + 2.0 * ([0.0, 0.2, 0.1] - held))


def test_sites_with_ends_are_stretched_too() -> None:
    """Both ends of the site scale."""
    spec = limb(
        '<geom type="capsule" size=".1 .2"/>'
        '<site name="s" type="capsule" size=".01" fromto="0 0 0 0 0 .4"/>'
    )
    model = built(spec, Stretch("link", 2.0))
    np.testing.assert_allclose(model.site("s").pos, [0.0, 0.0, 0.4])
    assert model.site("s").size[1] == pytest.approx(0.4)


def test_a_limb_is_resized_as_a_whole() -> None:
    """Lengths and strengths scale by the factor, masses by its cube; the anchor stays."""
    spec = leg()
    before = built(spec)
    resize_limb(spec, spec.body("thigh"), 0.5)
    after = built(spec)
    np.testing.assert_allclose(after.geom_size[2:], 0.5 * before.geom_size[2:])
    for body in ("thigh", "shin"):
        assert mass(after, body) == pytest.approx(0.125 * mass(before, body))
        np.testing.assert_allclose(
            after.body(body).inertia, 0.5**5 * before.body(body).inertia, rtol=1e-9
        )
    np.testing.assert_array_equal(after.body("thigh").pos, before.body("thigh").pos)
    np.testing.assert_allclose(after.body("shin").pos + after.joint("knee").pos, [0.0, 0.0, -0.15])
    for field in ("armature", "damping", "stiffness", "frictionloss"):
        for joint in ("hip", "knee"):
            np.testing.assert_allclose(
                getattr(after.joint(joint), field), 0.5 * getattr(before.joint(joint), field)
            )
    np.testing.assert_allclose(after.actuator_gear[:, 0], [10.0, 5.0])


def test_a_box_keeps_its_shape_when_it_is_resized() -> None:
    """All sides scale by the same factor, whichever was the longest."""
    spec = limb('<geom type="box" size=".1 .09 .05"/>')
    resize_limb(spec, spec.body("link"), 0.5)
    np.testing.assert_allclose(built(spec).geom_size[-1], [0.05, 0.045, 0.025])


@pytest.mark.parametrize("edit", [Stretch("link", 2.0), Radius("link", 2.0), Cut("link", 0.5)])
def test_meshes_cannot_be_reshaped(edit: Stretch | Radius | Cut) -> None:
    """Stretches, radii and cuts of meshes are refused."""
    with pytest.raises(
        MorphologyError, match="'link' holds 'horn', a mesh; only spheres, capsules"
    ):
        built(spec_of(_MESH), edit)


@pytest.mark.parametrize("edit", [Stretch("link", 2.0), Radius("link", 2.0), Cut("link", 0.5)])
def test_explicit_inertias_prevent_reshaping(edit: Stretch | Radius | Cut) -> None:
    """An explicit inertia would not follow the new shape."""
    with pytest.raises(
        MorphologyError, match="'link' has its inertia written out, so it would not"
    ):
        built(limb(_WRITTEN_OUT), edit)


def test_inertiafromgeom_allows_reshaping() -> None:
    """With `inertiafromgeom`, explicit inertias do not count."""
    spec = limb(_WRITTEN_OUT, 'inertiafromgeom="true"')
    require_geometry(spec, spec.body("link"))
    assert mass(built(spec, Radius("link", 2.0)), "link") > 2.0


def test_any_form_of_mass_is_scaled() -> None:
    """Densities, masses and explicit inertias are scaled."""
    for content in (
        '<geom type="capsule" size=".1 .2"/>',
        '<geom type="capsule" size=".1 .2" mass="3"/>',
        _WRITTEN_OUT,
        _WRITTEN_OUT.replace("diaginertia", "fullinertia").replace(".25", ".25 .01 .02 .03"),
    ):
        spec = limb(content)
        before = built(spec)
        scale_mass(spec.body("link"), 2.0)
        after = built(spec)
        assert mass(after, "link") == pytest.approx(2.0 * mass(before, "link"))
        np.testing.assert_allclose(after.body("link").inertia, 2.0 * before.body("link").inertia)
