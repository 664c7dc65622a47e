"""Laws of morphology edits."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import hypothesis.strategies as st
import msgspec
import mujoco
import numpy as np
import pytest
from hypothesis import assume, given, reject, settings

from shapechanger.errors import MorphologyError
from shapechanger.morphology import (
    EDITS,
    AddLimb,
    AddSegment,
    Damping,
    Density,
    Edit,
    Friction,
    Gear,
    JointRange,
    Lock,
    Mass,
    Radius,
    Remove,
    Split,
    StartHeight,
    Stiffness,
    Stretch,
    as_body,
    from_json,
    interpolate,
    to_json,
)
from tests.morphology.models import (
    ant,
    built,
    capsule_inertia,
    capsule_mass,
    differing,
    gantry,
    leg,
    limb,
    mass,
    pendulum,
    posed,
    tip,
    uncoupled_gantry,
)

# A fixed number of examples.
law = settings(max_examples=30)

FACTORS = st.floats(0.1, 10.0)
RATIOS = st.floats(0.01, 100.0)
PARTS = st.floats(0.01, 0.99)
NUMBERS = st.floats(allow_nan=False, allow_infinity=False)
SMALL = st.floats(-3.0, 3.0)
ANGLES = st.floats(-math.pi, math.pi)
BODIES = st.sampled_from(["trunk", "thigh", "shin", "*"])
LIMBS = st.sampled_from(["thigh", "shin", "[ts]hi*"])
MODELS: list[Callable[[], mujoco.MjSpec]] = [leg, gantry, ant, pendulum]


# --- Stretching and thickening -----------------------------------------------------------------


@law
@given(body=LIMBS, a=FACTORS, b=FACTORS)
@pytest.mark.parametrize("kind", [Stretch, Radius])
def test_edits_of_size_compose_by_multiplication(
    kind: type[Stretch | Radius], body: str, a: float, b: float
) -> None:
    """Two edits equal one edit by the product of their factors."""
    once, twice = built(leg(), kind(body, a * b)), built(leg(), kind(body, a), kind(body, b))
    for field in ("body_pos", "geom_pos", "geom_size", "site_pos", "jnt_pos"):
        np.testing.assert_allclose(
            getattr(twice, field), getattr(once, field), rtol=1e-6, atol=1e-12, err_msg=field
        )
    for field in ("body_mass", "body_inertia"):
        np.testing.assert_allclose(getattr(twice, field), getattr(once, field), rtol=1e-6)


@pytest.mark.parametrize("load", MODELS)
@pytest.mark.parametrize(
    "edit",
    [
        *(Stretch("*", 1.0), Radius("*", 1.0), Mass("*", scale=1.0), Density("*", scale=1.0)),
        *(Friction("*", scale=1.0), Damping("*", scale=1.0), Stiffness("*", scale=1.0)),
        *(Gear("*", scale=1.0), Stretch("*", 7.0, amount=0.0), Stretch("*", 1.0, "z")),
    ],
)
def test_a_factor_of_one_is_the_identity(load: Callable[[], mujoco.MjSpec], edit: Edit) -> None:
    assert differing(built(load()), built(load(), edit)) == []


@law
@given(factor=FACTORS, thickness=FACTORS, density=st.floats(1.0, 5000.0))
def test_masses_and_inertias_follow_from_geometry(
    factor: float, thickness: float, density: float
) -> None:
    """A capsule's mass and moments match the formulas after any edit of its size."""
    content = f'<geom type="capsule" size=".1" fromto="0 0 0 .3 0 .4" density="{density!r}"/>'
    model = built(limb(content), Stretch("link", factor), Radius("link", thickness))
    radius, length = 0.1 * thickness, 0.5 * factor
    across, along = capsule_inertia(radius, length, density)
    assert mass(model, "link") == pytest.approx(capsule_mass(radius, length, density))
    np.testing.assert_allclose(
        sorted(model.body("link").inertia), sorted([across, across, along]), rtol=1e-9
    )
    np.testing.assert_allclose(model.body("link").ipos, [0.15 * factor, 0.0, 0.2 * factor])


@law
@given(body=BODIES, factor=RATIOS)
def test_mass_scales_as_density(body: str, factor: float) -> None:
    """Scaling the mass equals scaling the density, and keeps the centres of mass."""
    before = built(leg())
    by_mass, by_density = (built(leg(), kind(body, scale=factor)) for kind in (Mass, Density))
    assert differing(by_mass, by_density) == []
    changed = before.body_mass != by_mass.body_mass
    for field in ("body_mass", "body_inertia"):
        old, new = getattr(before, field), getattr(by_mass, field)
        np.testing.assert_allclose(new[changed], factor * old[changed], rtol=1e-9)
        np.testing.assert_array_equal(new[~changed], old[~changed])
    np.testing.assert_allclose(by_mass.body_ipos, before.body_ipos, atol=1e-12)


# --- Order -------------------------------------------------------------------------------------


@law
@given(
    edits=st.tuples(
        st.one_of(
            st.builds(Stretch, st.just("thigh"), FACTORS),
            st.builds(Radius, st.just("thigh"), FACTORS),
            st.builds(Mass, st.just("thigh"), scale=FACTORS),
            st.builds(Damping, st.just("hip"), to=FACTORS),
            st.builds(JointRange, st.just("hip"), lower=st.floats(-3.0, -1.0)),
            st.builds(Gear, st.just("hip"), scale=FACTORS),
            st.builds(Lock, st.just("hip"), ANGLES),
        ),
        st.one_of(
            st.builds(Stretch, st.just("shin"), FACTORS),
            st.builds(Density, st.just("shin"), to=st.floats(1.0, 5000.0)),
            st.builds(Friction, st.just("sole"), to=FACTORS),
            st.builds(Lock, st.just("knee"), ANGLES),
            st.builds(AddSegment, st.just("shin"), st.just("foot"), st.just((0.1, 0.0, 0.0))),
            st.builds(Split, st.just("shin"), st.just("foot"), PARTS),
            st.builds(Remove, st.just("shin")),
            st.builds(StartHeight, st.just("trunk"), SMALL),
        ),
    )
)
def test_edits_of_different_bodies_commute(edits: tuple[Edit, Edit]) -> None:
    # A stretched segment carries the next one by its hinge; without a hinge, by its origin.
    assume(not (isinstance(edits[0], Stretch) and isinstance(edits[1], Lock)))
    a, b = built(leg(), *edits), built(leg(), *reversed(edits))
    for field in differing(a, b):
        np.testing.assert_allclose(
            getattr(a, field), getattr(b, field), rtol=1e-9, atol=1e-12, err_msg=field
        )


# --- Locking -----------------------------------------------------------------------------------


@law
@given(
    lock=st.sampled_from(["x", "yaw", "y", "pitch", "swing"]),
    positions=st.fixed_dictionaries({j: SMALL for j in ("x", "yaw", "y", "pitch", "swing")}),
)
def test_a_locked_joint_keeps_its_position(lock: str, positions: dict[str, float]) -> None:
    """The joint is a hinge or a slide, alone or with other joints of its body."""
    free = built(uncoupled_gantry())
    locked = built(uncoupled_gantry(), Lock(lock, positions[lock]))
    others = {joint: at for joint, at in positions.items() if joint != lock}
    a, b = posed(free, positions), posed(locked, others)
    np.testing.assert_allclose(b.geom_xpos, a.geom_xpos, atol=1e-12)
    np.testing.assert_allclose(b.geom_xmat, a.geom_xmat, atol=1e-12)
    np.testing.assert_allclose(b.site_xpos, a.site_xpos, atol=1e-12)


# --- Limbs -------------------------------------------------------------------------------------


@law
@given(at=PARTS, body=st.sampled_from(["thigh", "shin"]))
def test_a_split_keeps_length_and_ends(at: float, body: str) -> None:
    """The lengths of the parts add up, and sites keep their places."""
    before, after = built(leg()), built(leg(), Split(body, "half", at))
    lengths = [after.geom(name).size[1] for name in (body, f"{body}_of_half")]
    assert sum(lengths) == pytest.approx(before.geom(body).size[1])
    assert lengths[0] == pytest.approx(at * before.geom(body).size[1])
    for site in ("scar", "knee_cap", "toe"):
        np.testing.assert_allclose(tip(after, site), tip(before, site), atol=1e-12)


@law
@given(angle=ANGLES, hip=st.floats(-1.0, 0.5), knee=st.floats(-1.5, 0.0))
def test_a_copied_limb_is_rotated(angle: float, hip: float, knee: float) -> None:
    """The copy is rotated about the trunk's vertical axis, in every pose of its joints."""
    model = built(leg(), AddLimb("thigh", "_2", angle))
    data = posed(model, {"hip": hip, "hip_2": hip, "knee": knee, "knee_2": knee})
    cos, sin = math.cos(angle), math.sin(angle)
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    for geom in ("thigh", "shin", "sole"):
        old, new = data.geom(geom), data.geom(f"{geom}_2")
        np.testing.assert_allclose(new.xpos, turn @ old.xpos, atol=1e-12)
        np.testing.assert_allclose(
            new.xmat.reshape(3, 3), turn @ old.xmat.reshape(3, 3), atol=1e-12
        )
    for body in ("thigh", "shin"):
        np.testing.assert_array_equal(model.body(f"{body}_2").mass, model.body(body).mass)
        np.testing.assert_array_equal(model.body(f"{body}_2").inertia, model.body(body).inertia)


@pytest.mark.parametrize(
    ("load", "add", "name"),
    [
        (leg, AddLimb("thigh", "_2", 1.0), "thigh_2"),
        (leg, AddLimb("shin", "_2", 1.0, size=2.0), "shin_2"),
        (leg, AddSegment("shin", "foot", (0.1, 0.0, 0.0), gear=1.0), "foot"),
        (ant, AddLimb("right_back_leg", "_5", 0.7), "right_back_leg_5"),
        (uncoupled_gantry, AddLimb("boom", "_2", 0.7), "boom_2"),
    ],
)
def test_adding_and_removing_restores_the_model(
    load: Callable[[], mujoco.MjSpec], add: Edit, name: str
) -> None:
    assert differing(built(load()), built(load(), add)) != []
    assert differing(built(load()), built(load(), add, Remove(name))) == []


# --- Values ------------------------------------------------------------------------------------

_KINDS = [kind for kind in EDITS.values() if kind.__module__.startswith("shapechanger.")]
_SIMPLE: dict[Any, st.SearchStrategy[Any]] = {
    str: st.text(min_size=1, max_size=8),
    float: NUMBERS,
    type(None): st.none(),
    tuple: st.tuples(SMALL, SMALL, SMALL),
}


def _values_of(kind: Any) -> st.SearchStrategy[Any]:
    origin, parts = get_origin(kind), get_args(kind)
    if origin is Annotated and parts[0] is float:
        low, high = (
            next((end for end in ends if end is not None), None)
            for ends in ((parts[1].ge, parts[1].gt), (parts[1].le, parts[1].lt))
        )
        open_ends = {"exclude_min": parts[1].gt is not None, "exclude_max": parts[1].lt is not None}
        return st.floats(low, high, allow_nan=False, allow_infinity=False, **open_ends)
    if origin is Literal:
        return st.sampled_from(parts)
    if origin in (Union, UnionType):
        return st.one_of(*map(_values_of, parts))
    return _SIMPLE[parts[0] if origin is Annotated else origin or kind]


@st.composite
def _edits(draw: st.DrawFn, kind: type[Edit]) -> Edit:
    fields = {field.name: _values_of(field.type) for field in msgspec.structs.fields(kind)}
    for _ in range(20):
        with contextlib.suppress(MorphologyError):
            return kind(**draw(st.fixed_dictionaries(fields)))
    reject()


_BODIES = st.lists(st.sampled_from(_KINDS).flatmap(_edits), max_size=3).map(tuple)


@law
@given(data=st.data())
@pytest.mark.parametrize("kind", _KINDS)
def test_edits_round_trip_through_json(kind: type[Edit], data: st.DataObject) -> None:
    edit = data.draw(_edits(kind))
    text = to_json([edit])
    assert from_json(text) == (edit,) == as_body(text)
    assert f'"edit":"{kind.__struct_config__.tag}"' in text
    assert hash(from_json(text)) == hash((edit,))


@law
@given(a=_BODIES, b=_BODIES, alpha=st.floats(0.0, 1.0))
def test_interpolated_bodies_are_valid(
    a: tuple[Edit, ...], b: tuple[Edit, ...], alpha: float
) -> None:
    """Interpolated bodies round-trip through JSON; interpolating a body with itself returns it."""
    assert interpolate(a, b, 0.0) == a == interpolate(a, a, alpha)
    assert interpolate(a, b, 1.0) == b
    between = interpolate(a, b, alpha)
    assert from_json(to_json(between)) == between
