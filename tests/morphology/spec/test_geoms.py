"""Geoms: volumes as MuJoCo computes them, and growth that keeps the density."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.errors import MorphologyError
from shapechanger.morphology import Radius, Stretch
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
def test_volumes_are_those_of_the_compiler(shape: str) -> None:
    """At a density of 1 MuJoCo's mass is the volume."""
    spec = limb(f'<geom {shape} density="1"/>')
    (geom,) = spec.body("link").geoms
    assert volume(spec, geom) == pytest.approx(mass(built(spec), "link"), rel=1e-12)


@pytest.mark.parametrize("shape", _PRIMITIVES.values(), ids=_PRIMITIVES)
@pytest.mark.parametrize("edit", [Stretch("link", 1.7), Radius("link", 0.6)])
def test_a_mass_that_is_written_out_follows_the_volume(shape: str, edit: Stretch | Radius) -> None:
    """A geom of 3 kg grows as one of the same density does."""
    by_density = limb(f'<geom {shape} density="70"/>')
    before = mass(built(by_density), "link")
    by_mass = limb(f'<geom {shape} mass="{before!r}"/>')
    old, new = built(by_density, edit), built(by_mass, edit)
    np.testing.assert_allclose(new.body_mass, old.body_mass, rtol=1e-12)
    np.testing.assert_allclose(new.body_inertia, old.body_inertia, rtol=1e-9)


@pytest.mark.parametrize("shape", _PRIMITIVES.values(), ids=_PRIMITIVES)
def test_resizing_scales_volume_by_the_cube(shape: str) -> None:
    """Twice as large in every direction is eight times the volume, as seen from a point."""
    spec = limb(f'<geom {shape} density="1"/>')
    (geom,) = spec.body("link").geoms
    before, place = volume(spec, geom), place_of(geom)
    resize_geom(spec, geom, np.array([1.0, 0.0, 0.0]), 2.0)
    assert volume(spec, geom) == pytest.approx(8.0 * before)
    np.testing.assert_allclose(place_of(geom), 2.0 * place - [1.0, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("shape", _PRIMITIVES.values(), ids=_PRIMITIVES)
def test_moving_moves_however_the_place_is_written(shape: str) -> None:
    """Both ends move, or the middle."""
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
def test_orientations_are_read_however_they_are_written(written: str, compiler: str) -> None:
    """Every way to write an orientation gives the compiler's quaternion."""
    spec = limb(f'<geom name="g" type="capsule" size=".1 .2" {written}/>', compiler)
    model = built(spec)
    (geom,) = spec.body("link").geoms
    np.testing.assert_allclose(orientation(spec, geom), model.geom("g").quat, atol=1e-12)
    ends = axis_ends(spec, geom)
    assert ends is not None
    along = rotation(np.array(model.geom("g").quat))[:, 2]
    np.testing.assert_allclose(ends[1] - ends[0], 0.4 * along, atol=1e-12)


def test_attached_parts_keep_their_units() -> None:
    """A part in radians stays one when it is attached to a model in degrees."""
    part = limb('<geom name="g" type="capsule" size=".1 .2" euler="1 0 0"/>', 'angle="radian"')
    whole = spec_of("<mujoco><compiler angle='degree'/><worldbody/></mujoco>")
    whole.worldbody.add_frame().attach_body(part.body("trunk"), "part_", "")
    np.testing.assert_allclose(
        orientation(whole, whole.geom("part_g")), [np.cos(0.5), np.sin(0.5), 0.0, 0.0]
    )


def _sizes(content: str, edit: Stretch | Radius) -> list[float]:
    """The compiled half-sizes of the link's geom after an edit."""
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
def test_what_grows_is_what_lies_along_the_axis(
    content: str, axis: str | None, sizes: list[float]
) -> None:
    """A box grows along any axis of its own, a capsule along one only."""
    edit = Stretch("link", 2.0, axis)  # type: ignore[arg-type]
    np.testing.assert_allclose(_sizes(content, edit), sizes, atol=1e-12)


@pytest.mark.parametrize("shape", ["capsule", "box"])
def test_an_oblique_geom_cannot_grow_along_an_axis(shape: str) -> None:
    """It would become another shape; the message says what can be done."""
    content = f'<geom name="g" type="{shape}" size=".1 .2 .3" euler="0 30 0"/>'
    with pytest.raises(
        MorphologyError, match="'g' lies oblique to the axis 'z': stretch it along all"
    ):
        _sizes(content, Stretch("link", 2.0, "z"))


def test_oblique_ends_are_stretched_along_an_axis() -> None:
    """As the pole is, which leans by a millimetre and keeps doing so."""
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
def test_thickness_is_what_length_is_not(content: str, sizes: list[float]) -> None:
    """The longest of three half-sizes is the length, the other two are the thickness."""
    np.testing.assert_allclose(_sizes(content, Radius("link", 3.0)), sizes)


def test_only_long_geoms_have_ends() -> None:
    """A box has no axis to build on."""
    spec = limb('<geom type="box" size=".1 .2 .3"/>')
    assert axis_ends(spec, spec.body("link").geoms[0]) is None
