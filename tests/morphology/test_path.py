"""Interpolation between two bodies."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np
import pytest

from shapechanger.envs.ant import ANT
from shapechanger.errors import MorphologyError
from shapechanger.morphology import (
    EDITS,
    AddFloor,
    AddFreeJoint,
    AddLimb,
    AddMotor,
    AddSegment,
    Body,
    Cut,
    Damping,
    Density,
    Edit,
    Friction,
    Gear,
    Gravity,
    JointRange,
    Lock,
    Mass,
    PlaceBody,
    PlaceGeom,
    Radius,
    Remove,
    Split,
    StartHeight,
    Stiffness,
    Stretch,
    TotalMass,
    interpolate,
)
from tests.morphology.models import ant, built, leg, mass, physics

# One edit of each kind, for the leg.
ONE_OF_EACH: tuple[Edit, ...] = (
    Stretch("thigh", 2.0),
    Radius("thigh", 1.5),
    Cut("thigh", 0.4),
    Remove("thigh"),
    Split("thigh", "half", gear=3.0),
    AddSegment("shin", "foot", (0.1, 0.0, 0.0), gear=2.0),
    AddLimb("thigh", "_2", 2.0, size=1.5),
    Mass("shin", to=1.0),
    Density("thigh", scale=2.0),
    Gear("*", to=30.0),
    Damping("hip", scale=3.0),
    Stiffness("knee", to=2.0),
    Friction("*", scale=0.2),
    JointRange("knee", -0.5, 0.2),
    Lock("knee", -0.5),
    Gravity((1.0, 0.0, -3.0)),
    StartHeight("trunk", 2.0),
    PlaceBody("shin", (0.1, 0.0, -0.4)),
    PlaceGeom("thigh", (0.0, 0.0, 0.1), (0.0, 0.1, -0.4), radius=0.05),
    TotalMass(7.0),
)
_STEP = 1e-5


def test_all_kinds_are_covered() -> None:
    """A new kind of edit must be added to these tests."""
    rigging = (AddMotor, AddFreeJoint, AddFloor)  # The leg already has these.
    shipped = {kind for kind in EDITS.values() if kind.__module__.startswith("shapechanger.")}
    assert {*(type(edit) for edit in ONE_OF_EACH), *rigging} == shipped
    assert all(kind.__struct_config__.tag == name for name, kind in EDITS.items())
    assert {"stretch", "joint_range", "add_free_joint", "total_mass"} <= EDITS.keys()


@pytest.mark.parametrize("alpha", [-0.1, 1.1, np.nan, np.inf])
def test_alpha_is_a_fraction(alpha: float) -> None:
    with pytest.raises(MorphologyError, match="alpha must be between 0 and 1, got"):
        interpolate((), (), alpha)


def test_common_edits_are_interpolated() -> None:
    a = (Stretch("thigh", 1.0, "z"), Gravity((0.0, 0.0, -10.0)), JointRange("hip", -1.0, 1.0))
    b = (Stretch("thigh", 3.0, "z"), Gravity((4.0, 0.0, -2.0)), JointRange("hip", -2.0, 1.0))
    assert interpolate(a, b, 0.25) == (
        Stretch("thigh", 1.5, "z"),
        Gravity((1.0, 0.0, -8.0)),
        JointRange("hip", -1.25, 1.0),
    )


def test_edits_that_only_one_body_has_fade() -> None:
    a = (Mass("*", scale=2.0), Stretch("thigh", 2.0))
    b = (Mass("*", scale=2.0), Stretch("shin", 2.0), Gear("*", scale=3.0))
    assert interpolate(a, b, 0.25) == (
        Mass("*", scale=2.0),
        Stretch("thigh", 2.0, amount=0.75),
        Stretch("shin", 2.0, amount=0.25),
        Gear("*", scale=3.0, amount=0.25),
    )


def test_a_motor_of_one_body_fades() -> None:
    """Between a segment with a motor and one without, the motor's gear is interpolated."""
    passive, active = ANT.body("ExtendedAntPassive"), ANT.body("ExtendedAnt")
    for alpha in (0.01, 0.5, 0.99):
        for path in (interpolate(passive, active, alpha), interpolate(active, passive, 1 - alpha)):
            model = built(ant(), *path)
            assert (model.nq, model.nu) == (19, 12)
            assert model.actuator("foot_1").gear[0] == pytest.approx(150.0 * alpha)
    np.testing.assert_array_equal(
        built(ant(), *interpolate(passive, active, 0.5)).body_mass, built(ant(), *active).body_mass
    )


def _assert_continuous(
    load: Callable[[], mujoco.MjSpec], a: Body, b: Body, tolerance: float = 1e-3
) -> None:
    for alpha in (0.0, _STEP, 0.3, 0.5, 0.99, 1.0 - _STEP):
        near = [built(load(), *interpolate(a, b, min(x, 1.0))) for x in (alpha, alpha + _STEP)]
        before, after = (physics(model, {"knee": -0.5}) for model in near)
        jumping = {f"range {edit.joint}" for edit in (*a, *b) if isinstance(edit, Lock)}
        for edit in (*a, *b):
            if isinstance(edit, Split):  # The geom of this name becomes one half.
                jumping |= {f"place {edit.body}", f"size {edit.body}"}
        for name in before.keys() & after.keys() - jumping:
            np.testing.assert_allclose(
                after[name], before[name], rtol=tolerance, atol=tolerance, err_msg=f"{name} {alpha}"
            )


@pytest.mark.parametrize("edit", ONE_OF_EACH, ids=lambda edit: type(edit).__name__)
def test_every_kind_of_edit_is_continuous(edit: Edit) -> None:
    # The rounded ends at a split are displaced.
    tolerance = 5e-3 if isinstance(edit, Split) else 1e-3
    _assert_continuous(leg, (), (edit,), tolerance)
    _assert_continuous(leg, (edit,), (), tolerance)


def test_two_edits_can_shrink_one_limb() -> None:
    grown = (AddSegment("shin", "foot", (0.1, 0.0, 0.0)), AddLimb("thigh", "_2", 1.0, size=0.01))
    for alpha in (1e-9, 0.5, 1.0 - 1e-9):
        model = built(leg(), *interpolate(grown, (Remove("thigh"),), alpha))
        assert model.nbody == 8  # The foot is copied with the limb.
        assert mass(model, "foot") > 0.0
