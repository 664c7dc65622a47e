"""Segments: anchors, far ends, and children that move along."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.errors import MorphologyError
from shapechanger.morphology import Cut, Radius, Stretch
from shapechanger.morphology.spec.geometry import (
    require_geometry,
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


def test_the_hopper_stretches_in_place() -> None:
    """The torso does not rise, although its root slides are defined at the floor."""
    model = built(asset_spec("hopper"), Stretch("torso", 1.5))
    np.testing.assert_array_equal(model.geom("torso_geom").pos, [0.0, 0.0, 0.0])
    np.testing.assert_allclose(model.body("thigh").pos, [0.0, 0.0, -0.3])


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
    spec = limb(
        '<geom type="capsule" size=".1 .2"/>'
        '<site name="s" type="capsule" size=".01" fromto="0 0 0 0 0 .4"/>'
    )
    model = built(spec, Stretch("link", 2.0))
    np.testing.assert_allclose(model.site("s").pos, [0.0, 0.0, 0.4])
    assert model.site("s").size[1] == pytest.approx(0.4)


@pytest.mark.parametrize("edit", [Stretch("link", 2.0), Radius("link", 2.0), Cut("link", 0.5)])
def test_meshes_cannot_be_reshaped(edit: Stretch | Radius | Cut) -> None:
    with pytest.raises(
        MorphologyError, match="'link' holds 'horn', a mesh; only spheres, capsules"
    ):
        built(spec_of(_MESH), edit)


@pytest.mark.parametrize("edit", [Stretch("link", 2.0), Radius("link", 2.0), Cut("link", 0.5)])
def test_explicit_inertias_prevent_reshaping(edit: Stretch | Radius | Cut) -> None:
    with pytest.raises(
        MorphologyError, match="'link' has its inertia written out, so it would not"
    ):
        built(limb(_WRITTEN_OUT), edit)


def test_inertiafromgeom_allows_reshaping() -> None:
    spec = limb(_WRITTEN_OUT, 'inertiafromgeom="true"')
    require_geometry(spec, spec.body("link"))
    assert mass(built(spec, Radius("link", 2.0)), "link") > 2.0
