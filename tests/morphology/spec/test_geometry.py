"""Geoms and segments: volume, orientation, size, and elements that move with a segment."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.errors import MorphologyError
from shapechanger.morphology import AddLimb, Cut, Edit, Radius, Remove, Stretch
from shapechanger.morphology.spec.geometry import axis_ends, orientation, rotation
from tests.morphology.models import built, gantry, leg, limb, mass, spec_of

_PRIMITIVES = {
    "sphere": 'type="sphere" size=".2"',
    "capsule": 'type="capsule" size=".1 .3"',
    "capsule with ends": 'type="capsule" size=".1" fromto="0 0 0 .3 .4 0"',
    "cylinder": 'type="cylinder" size=".1 .3"',
    "cylinder with ends": 'type="cylinder" size=".1" fromto="0 0 0 .3 .4 0"',
    "box": 'type="box" size=".1 .2 .3"',
    "box with ends": 'type="box" size=".1 .2" fromto="0 0 0 .3 .4 0"',
    "ellipsoid": 'type="ellipsoid" size=".1 .2 .3"',
    "ellipsoid with ends": 'type="ellipsoid" size=".1" fromto="0 0 0 .3 .4 0"',
}


@pytest.mark.parametrize("shape", _PRIMITIVES.values(), ids=_PRIMITIVES)
@pytest.mark.parametrize("edit", [Stretch("link", 1.7), Radius("link", 0.6)])
def test_explicit_masses_scale_with_the_volume(shape: str, edit: Stretch | Radius) -> None:
    by_density = limb(f'<geom {shape} density="70"/>')
    before = mass(built(by_density), "link")
    by_mass = limb(f'<geom {shape} mass="{before!r}"/>')
    old, new = built(by_density, edit), built(by_mass, edit)
    np.testing.assert_allclose(new.body_mass, old.body_mass, rtol=1e-12)
    np.testing.assert_allclose(new.body_inertia, old.body_inertia, rtol=1e-9)


@pytest.mark.parametrize(
    "written",
    [
        *('quat="2 1 0 -1"', 'euler="30 40 50"', 'axisangle="1 2 3 70"', 'zaxis="1 2 3"'),
        'xyaxes="1 1 0 0 0 1"',
    ],
)
@pytest.mark.parametrize("compiler", ["", 'angle="radian"', 'eulerseq="ZYx"'])
def test_any_form_of_orientation_is_read(written: str, compiler: str) -> None:
    spec = limb(f'<geom name="g" type="capsule" size=".1 .2" {written}/>', compiler)
    model = built(spec)
    (geom,) = spec.body("link").geoms
    np.testing.assert_allclose(orientation(geom), model.geom("g").quat, atol=1e-12)
    ends = axis_ends(geom)
    assert ends is not None
    along = rotation(np.array(model.geom("g").quat))[:, 2]
    np.testing.assert_allclose(ends[1] - ends[0], 0.4 * along, atol=1e-12)


def test_attached_parts_keep_their_units() -> None:
    part = limb('<geom name="g" type="capsule" size=".1 .2" euler="1 0 0"/>', 'angle="radian"')
    whole = spec_of("<mujoco><compiler angle='degree'/><worldbody/></mujoco>")
    whole.worldbody.add_frame().attach_body(part.body("trunk"), "part_", "")
    np.testing.assert_allclose(
        orientation(whole.geom("part_g")), [np.cos(0.5), np.sin(0.5), 0.0, 0.0]
    )


def _sizes(content: str, edit: Stretch | Radius) -> list[float]:
    return built(limb(content), edit).geom_size[-1].tolist()


@pytest.mark.parametrize(
    ("content", "axis", "sizes"),
    [
        ('<geom type="box" size=".1 .2 .3"/>', None, [0.1, 0.2, 0.6]),
        ('<geom type="box" size=".1 .2 .3"/>', "x", [0.2, 0.2, 0.3]),
        ('<geom type="ellipsoid" size=".1 .2 .3" euler="90 0 0"/>', "z", [0.1, 0.4, 0.3]),
        ('<geom type="capsule" size=".1 .3"/>', "z", [0.1, 0.6, 0.0]),
        ('<geom type="capsule" size=".1 .3"/>', "x", [0.1, 0.3, 0.0]),
        ('<geom type="capsule" size=".1 .3" euler="0 90 0"/>', "x", [0.1, 0.6, 0.0]),
        ('<geom type="sphere" size=".1"/>', "x", [0.1, 0.0, 0.0]),
        ('<geom type="box" size=".1" fromto="0 0 0 .3 .4 0"/>', None, [0.1, 0.1, 0.5]),
    ],
)
def test_stretches_apply_along_the_axis(content: str, axis: str | None, sizes: list[float]) -> None:
    edit = Stretch("link", 2.0, axis)  # type: ignore[arg-type]
    np.testing.assert_allclose(_sizes(content, edit), sizes, atol=1e-12)


@pytest.mark.parametrize("shape", ["capsule", "box"])
def test_an_oblique_geom_cannot_be_stretched_along_an_axis(shape: str) -> None:
    content = f'<geom name="g" type="{shape}" size=".1 .2 .3" euler="0 30 0"/>'
    with pytest.raises(MorphologyError, match="'g' lies oblique to the axis: stretch it along"):
        _sizes(content, Stretch("link", 2.0, "z"))


@pytest.mark.parametrize(
    ("content", "sizes"),
    [
        ('<geom type="sphere" size=".1"/>', [0.3, 0.0, 0.0]),
        ('<geom type="cylinder" size=".1 .3"/>', [0.3, 0.3, 0.0]),
        ('<geom type="box" size=".1 .3 .2"/>', [0.3, 0.3, 0.6]),
        ('<geom type="box" size=".1" fromto="0 0 0 .3 .4 0"/>', [0.3, 0.3, 0.25]),
        ('<geom type="ellipsoid" size=".1" fromto="0 0 0 .3 .4 0"/>', [0.3, 0.3, 0.25]),
    ],
)
def test_the_longest_side_is_the_length(content: str, sizes: list[float]) -> None:
    """`Radius` scales the other two half-sizes."""
    np.testing.assert_allclose(_sizes(content, Radius("link", 3.0)), sizes)


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


def test_children_move_along_with_a_stretch() -> None:
    model = built(leg(), Stretch("thigh", 2.0))
    np.testing.assert_allclose(model.site("scar").pos, [0.0, 0.0, -0.12])
    # The knee, 5 cm below the shin's origin, stays at the end of the thigh.
    np.testing.assert_allclose(model.body("shin").pos + model.joint("knee").pos, [0.0, 0.0, -0.6])
    np.testing.assert_array_equal(model.joint("knee").pos, [0.0, 0.0, -0.05])
    rig = built(gantry(), Stretch("rig", 2.0))
    held = np.array([0.3, 0.1, 0.0])
    np.testing.assert_allclose(rig.joint("yaw").pos, held)
    np.testing.assert_allclose(rig.joint("pitch").pos, held + 2.0 * ([0.0, 0.2, 0.1] - held))


@pytest.mark.parametrize(
    "edit",
    [
        *(Stretch("link", 2.0), Radius("link", 2.0), Cut("link", 0.5)),
        *(AddLimb("link", "_2", 1.0, size=2.0), Remove("link").partly(0.5)),
    ],
)
def test_meshes_and_explicit_inertias_prevent_reshaping(edit: Edit) -> None:
    """A limb with a mesh can still be removed."""
    with pytest.raises(
        MorphologyError, match=r"'link\w*' holds 'horn\w*', a mesh, height field or SDF; only"
    ):
        built(spec_of(_MESH), edit)
    with pytest.raises(
        MorphologyError, match=r"'link\w*' has its inertia written out, so it would n"
    ):
        built(limb(_WRITTEN_OUT), edit)
    assert built(spec_of(_MESH), Remove("link")).nbody == 2
