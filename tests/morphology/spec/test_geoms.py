"""Geoms: volume, orientation and size."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.errors import MorphologyError
from shapechanger.morphology import Radius, Stretch
from shapechanger.morphology.spec.explicit import make_explicit
from shapechanger.morphology.spec.geometry import (
    axis_ends,
    move_by,
    orientation,
    place_of,
    resize_geom,
    rotation,
    volume,
)
from tests.morphology.models import built, limb, mass, spec_of

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
def test_volumes_match_the_compiler(shape: str) -> None:
    """At a density of 1, MuJoCo's mass is the volume."""
    spec = limb(f'<geom {shape} density="1"/>')
    (geom,) = spec.body("link").geoms
    assert volume(geom) == pytest.approx(mass(built(spec), "link"), rel=1e-12)


@pytest.mark.parametrize("shape", _PRIMITIVES.values(), ids=_PRIMITIVES)
@pytest.mark.parametrize("edit", [Stretch("link", 1.7), Radius("link", 0.6)])
def test_explicit_masses_scale_with_the_volume(shape: str, edit: Stretch | Radius) -> None:
    """An explicit mass scales as one from a density."""
    by_density = limb(f'<geom {shape} density="70"/>')
    before = mass(built(by_density), "link")
    by_mass = limb(f'<geom {shape} mass="{before!r}"/>')
    old, new = built(by_density, edit), built(by_mass, edit)
    np.testing.assert_allclose(new.body_mass, old.body_mass, rtol=1e-12)
    np.testing.assert_allclose(new.body_inertia, old.body_inertia, rtol=1e-9)


@pytest.mark.parametrize("shape", _PRIMITIVES.values(), ids=_PRIMITIVES)
def test_resizing_scales_volume_by_the_cube(shape: str) -> None:
    """Size and distance from the fixed point scale by the factor."""
    spec = limb(f'<geom {shape} density="1"/>')
    (geom,) = spec.body("link").geoms
    before, place = volume(geom), place_of(geom)
    resize_geom(geom, np.array([1.0, 0.0, 0.0]), 2.0)
    assert volume(geom) == pytest.approx(8.0 * before)
    np.testing.assert_allclose(place_of(geom), 2.0 * place - [1.0, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("shape", _PRIMITIVES.values(), ids=_PRIMITIVES)
def test_any_form_of_position_can_be_moved(shape: str) -> None:
    """Both ends or the centre move."""
    spec = limb(f"<geom {shape}/>")
    (geom,) = spec.body("link").geoms
    before = built(spec).geom_pos[-1]
    shift = np.array([1.0, 2.0, 3.0])
    move_by(geom, shift)
    np.testing.assert_allclose(built(spec).geom_pos[-1], before + shift, atol=1e-12)


@pytest.mark.parametrize(
    "written",
    [
        *('quat="2 1 0 -1"', 'euler="30 40 50"', 'axisangle="1 2 3 70"', 'zaxis="1 2 3"'),
        'xyaxes="1 1 0 0 0 1"',
    ],
)
@pytest.mark.parametrize("compiler", ["", 'angle="radian"', 'eulerseq="ZYx"'])
def test_any_form_of_orientation_is_read(written: str, compiler: str) -> None:
    """Every form gives the compiler's quaternion."""
    spec = limb(f'<geom name="g" type="capsule" size=".1 .2" {written}/>', compiler)
    model = built(spec)
    make_explicit(spec)
    (geom,) = spec.body("link").geoms
    np.testing.assert_allclose(orientation(geom), model.geom("g").quat, atol=1e-12)
    ends = axis_ends(geom)
    assert ends is not None
    along = rotation(np.array(model.geom("g").quat))[:, 2]
    np.testing.assert_allclose(ends[1] - ends[0], 0.4 * along, atol=1e-12)


def test_attached_parts_keep_their_units() -> None:
    """A part in radians keeps its unit within a model in degrees."""
    part = limb('<geom name="g" type="capsule" size=".1 .2" euler="1 0 0"/>', 'angle="radian"')
    whole = spec_of("<mujoco><compiler angle='degree'/><worldbody/></mujoco>")
    whole.worldbody.add_frame().attach_body(part.body("trunk"), "part_", "")
    make_explicit(whole)
    np.testing.assert_allclose(
        orientation(whole.geom("part_g")), [np.cos(0.5), np.sin(0.5), 0.0, 0.0]
    )


def _sizes(content: str, edit: Stretch | Radius) -> list[float]:
    """Return the compiled half-sizes of the link's geom after an edit."""
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
    """A box stretches along any of its axes, a capsule along one."""
    edit = Stretch("link", 2.0, axis)  # type: ignore[arg-type]
    np.testing.assert_allclose(_sizes(content, edit), sizes, atol=1e-12)


@pytest.mark.parametrize("shape", ["capsule", "box"])
def test_an_oblique_geom_cannot_be_stretched_along_an_axis(shape: str) -> None:
    """The error suggests a stretch along all axes."""
    content = f'<geom name="g" type="{shape}" size=".1 .2 .3" euler="0 30 0"/>'
    with pytest.raises(
        MorphologyError, match="'g' lies oblique to the axis 'z': stretch it along all"
    ):
        _sizes(content, Stretch("link", 2.0, "z"))


def test_oblique_ends_are_stretched_along_an_axis() -> None:
    model = built(
        limb('<geom type="capsule" size=".1" fromto="0 0 0 .3 0 .4"/>'), Stretch("link", 2.0, "z")
    )
    assert model.geom_size[-1, 1] == pytest.approx(0.5 * np.hypot(0.3, 0.8))
    np.testing.assert_allclose(model.geom_pos[-1], [0.15, 0.0, 0.4])


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


def test_only_long_geoms_have_ends() -> None:
    """Boxes with a size have no axis."""
    spec = limb('<geom type="box" size=".1 .2 .3"/>')
    assert axis_ends(spec.body("link").geoms[0]) is None
