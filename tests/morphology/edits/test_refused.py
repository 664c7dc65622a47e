"""What edits refuse when they are made, and when they are applied."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

import msgspec
import numpy as np
import pytest

from shapechanger.errors import MorphologyError, UnknownName
from shapechanger.morphology import (
    AddFloor,
    AddFreeJoint,
    AddLimb,
    AddMotor,
    AddSegment,
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
)
from tests.morphology.models import ant, arm, built, gantry, leg, limb, spec_of

_VALUES: list[Any] = [Mass, Density, Gear, Damping, Stiffness, Friction]
_RATIO = (0.0, -1.0, 1e-3, 1e3)
_END = (0.0, 0.0, 1.0)
# Edits, and numbers that a field cannot be, apart from NaN and infinity.
_OUT_OF_RANGE: list[tuple[Edit, str, tuple[float, ...]]] = [
    (Stretch("a", 2.0), "amount", (-0.1, 1.1)),
    (Stretch("a", 2.0), "factor", _RATIO),
    (Radius("a", 2.0), "factor", _RATIO),
    (Cut("a", 0.5), "keep", (*_RATIO, 1.001)),
    (AddLimb("a", "_2", 1.0), "size", _RATIO),
    (AddLimb("a", "_2", 1.0), "angle", ()),
    *((kind("a", scale=2.0), "scale", _RATIO) for kind in _VALUES),
    (Mass("a", to=2.0), "to", (0.0, -1.0, 2e6)),
    *((kind("a", to=2.0), "to", (-0.1, 2e6)) for kind in _VALUES if kind not in (Mass, Gear)),
    (Gear("a", to=2.0), "to", (-2e6, 2e6)),
    (Split("a", "b"), "at", (0.0, 1.0, -0.5, 1.5)),
    *((Split("a", "b"), field, ()) for field in ("lower", "upper", "gear")),
    (AddSegment("a", "b", _END), "radius", (0.0, -0.1)),
    *((AddSegment("a", "b", _END), field, ()) for field in ("lower", "upper", "gear")),
    *((JointRange("a", -1.0, 1.0), field, ()) for field in ("lower", "upper")),
    (Lock("a"), "position", ()),
    (StartHeight("a", 1.0), "to", (101.0, -101.0, 1e300)),
    (AddMotor("a"), "gear", ()),
    (AddFloor(), "friction", (-1.0,)),
    (AddFloor(), "height", ()),
    (PlaceGeom("a", radius=1.0), "radius", (0.0, -1.0)),
    (TotalMass(1.0), "to", (0.0, -1.0, 2e6)),
]


@pytest.mark.parametrize(("edit", "field", "wrong"), _OUT_OF_RANGE)
def test_numbers_out_of_range_are_refused_when_the_edit_is_made(
    edit: Edit, field: str, wrong: tuple[float, ...]
) -> None:
    """The sentence names the field, its range and the number."""
    for number in (*wrong, math.nan, math.inf, -math.inf):
        message = f"{field} of {type(edit).__name__}: Expected .*, got {re.escape(str(number))}"
        with pytest.raises(MorphologyError, match=message):
            type(edit)(**{**msgspec.structs.asdict(edit), field: number})


@pytest.mark.parametrize(
    ("edit", "field"),
    [
        (Gravity(_END), "to"),
        (PlaceBody("a", _END), "to"),
        (PlaceGeom("a", middle=_END), "middle"),
        (PlaceGeom("a", _END, (0.0, 0.0, 0.0)), "end"),
        (AddSegment("a", "b", _END), "end"),
        (Split("a", "b", axis=_END), "axis"),
    ],
)
@pytest.mark.parametrize(
    "vector", [(math.nan, 0.0, 1.0), (0.0, math.inf, 1.0), (1.0, 2.0), (1.0, 2.0, 3.0, 4.0), (), 1]
)
def test_vectors_are_three_finite_numbers(edit: Edit, field: str, vector: Any) -> None:
    with pytest.raises(MorphologyError, match=f"{field} of {type(edit).__name__}: Expected .*"):
        type(edit)(**{**msgspec.structs.asdict(edit), field: vector})


@pytest.mark.parametrize(
    ("make", "message"),
    [
        *(
            (lambda kind=kind, x=x: kind("*", **x), f"{kind.__name__} takes either scale or to")
            for kind in _VALUES
            for x in ({}, {"scale": 2.0, "to": 3.0})
        ),
        *(
            (lambda make=make, wrong=wrong: make(**wrong), message)
            for make in (
                lambda **wrong: Split("a", "b", **wrong),
                lambda **wrong: AddSegment("a", "b", _END, **wrong),
            )
            for wrong, message in (
                ({"lower": 1.0, "upper": 1.0}, "A hinge needs a lower limit below its upper one"),
                ({"gear": 0.0}, r"A motor needs a gear that is not zero, got 0\.0"),
                ({"axis": (0.0, 0.0, 0.0)}, "The axis of a hinge must not be zero"),
            )
        ),
        (lambda: AddMotor("a", 0.0), "a gear that is not zero"),
        (lambda: Gear("a", to=0.0), "a gear that is not zero"),
        (lambda: AddSegment("a", "b", (0.0, 0.0, 0.0)), "The end of a segment must not be zero"),
        (lambda: AddLimb("a", "", 1.0), "suffix of AddLimb: Expected `str` of length >= 1"),
        (lambda: JointRange("hip"), "needs a lower or upper limit"),
        (lambda: JointRange("hip", 2.0, 1.0), "lower limit must be below the upper one"),
        (lambda: Gravity((200.0, 0.0, -200.0)), "Gravity is at most 250 m/s², got 282.8"),
        (lambda: PlaceGeom("a", start=_END), "An axis has a start and an end, got"),
        (lambda: PlaceGeom("a", _END, _END), "by two different ends or by its middle"),
        (lambda: PlaceGeom("a"), "PlaceGeom takes two ends, a middle or a radius"),
        (lambda: Mass("a", scale=np.array([1.0, 2.0])), "scale of Mass: Expected `float | null`"),  # type: ignore[arg-type]
        (lambda: Stretch(3, 2.0), "body of Stretch: Expected `str`, got `int`"),  # type: ignore[arg-type]
    ],
)
def test_values_that_do_not_fit_each_other_are_refused(
    make: Callable[[], Edit], message: str
) -> None:
    with pytest.raises(MorphologyError, match=message):
        make()


@pytest.mark.parametrize(
    ("edit", "kind", "near"),
    [
        *((kind("shinn", scale=2.0), "body", "shin") for kind in (Mass, Density)),
        *((kind("kneee", scale=2.0), "joint", "knee") for kind in (Damping, Stiffness)),
        *((kind("shim", 2.0), "body", "shin") for kind in (Stretch, Radius)),
        (Gear("kneee", scale=2.0), "actuator", "knee"),
        (Friction("flor", to=2.0), "geom", "floor"),
        *((edit, "body", "shin") for edit in (Cut("shim", 0.5), Remove("shim"))),
        *((edit, "body", "shin") for edit in (Split("shim", "toe"), AddLimb("shim", "_2", 1.0))),
        (AddSegment("shim", "toe", _END), "body", "shin"),
        *((edit, "joint", "knee") for edit in (JointRange("kneee", -1.0, 1.0), Lock("kneee"))),
        (AddMotor("kneee"), "joint", "knee"),
        (AddFreeJoint("trank"), "trunk", "trunk"),
        (StartHeight("trank", 1.0), "trunk", "trunk"),
        (PlaceBody("shim", _END), "body", "shin"),
        (PlaceGeom("shim", radius=1.0), "geom", "shin"),
    ],
)
def test_the_nearest_element_of_the_kind_is_suggested(edit: Edit, kind: str, near: str) -> None:
    with pytest.raises(UnknownName, match=rf"No {kind} matches '\w+'\. Did you mean '{near}'\?"):
        built(leg(), edit)


@pytest.mark.parametrize(
    ("load", "edit", "message"),
    [
        *(
            (leg, edit, f"'trunk' is the trunk .* so it cannot be {what}")
            for edit, what in (
                *(
                    (Cut("trunk", 0.5), "cut"),
                    (Remove("trunk"), "removed"),
                    (Remove("*"), "removed"),
                ),
                *((Split("trunk", "toe"), "split"), (AddLimb("trunk", "_2", 1.0), "copied")),
            )
        ),
        *(
            (ant, edit, "'root' is neither a hinge nor a slide, so it has no range")
            for edit in (JointRange("*", -1.0, 1.0), Lock("root"))
        ),
        (leg, JointRange("knee", lower=1.0), r"The range of 'knee' would be 1 to 0\."),
        *(
            (gantry, edit, "'y' slides without limits: give both of them")
            for edit in (JointRange("y", lower=-1.0), JointRange("y", upper=1.0))
        ),
        (gantry, Lock("y"), "'y' slides without limits, so it has no middle"),
        (
            leg,
            AddSegment("trunk", "tail", (1.0, 0.0, 0.0), axis=(0.0, 1.0, 0.0)),
            "'trunk' has no capsule or cylinder, so it has no far",
        ),
        (
            lambda: limb('<geom size=".1"/><body name="frame" pos="0 0 1"/>'),
            Mass("frame", to=1.0),
            "'frame' has no mass, so none can be set",
        ),
        (
            lambda: limb('<geom name="g" size=".1" mass="2"/>'),
            Density("link", scale=2.0),
            "'g' has its mass written out, so its density has",
        ),
        (
            lambda: limb(
                '<inertial pos="0 0 0" mass="2" diaginertia=".1 .1 .1"/><geom size=".1"/>'
            ),
            Density("link", scale=2.0),
            "'link' has its inertia written out, so its density",
        ),
        (
            lambda: spec_of('<mujoco><worldbody><geom size=".1"/></worldbody></mujoco>'),
            AddMotor("*"),
            "has no joints, so there is nothing to add a motor",
        ),
        (leg, PlaceGeom("sole", (0.0, 0.0, 0.0), _END), "'sole' is no capsule or cylinder"),
        (leg, PlaceGeom("trunk", radius=0.1), "'trunk' is no sphere, capsule or cylinder"),
        (leg, AddMotor("*"), r"matches '\*' has a motor, or none matches"),
        (leg, AddFreeJoint("trunk"), "'trunk' is not fixed: it has the joint 'root'"),
        (leg, AddFloor(), "A new geom needs an unused name, got 'floor'"),
        (ant, StartHeight("aux_1", 1.0), r"No trunk matches 'aux_1'\..* There are: torso\."),
    ],
)
def test_what_a_model_cannot_have_is_refused_when_the_edit_is_applied(
    load: Any, edit: Edit, message: str
) -> None:
    """The sentence names the element, and the way out."""
    with pytest.raises((MorphologyError, UnknownName), match=message):
        built(load(), edit)


@pytest.mark.parametrize(
    ("flag", "edit", "what"),
    [
        ("gravity", Gravity((0.0, 0.0, -1.0)), "gravity"),
        ("damper", Damping("*", to=1.0), "dampers"),
        ("spring", Stiffness("*", to=1.0), "springs"),
        ("actuation", AddMotor("*", 1.0), "actuators"),
        ("limit", JointRange("lower", 0.0, 1.0), "limits of joints"),
        ("contact", Friction("*", to=0.5), "contacts"),
    ],
)
def test_an_edit_of_what_is_switched_off_is_refused(flag: str, edit: Edit, what: str) -> None:
    spec = arm(top=f'<option><flag {flag}="disable"/></option>')
    with pytest.raises(MorphologyError, match=f"would change nothing, .* switches {what} off"):
        built(spec, edit)
    if what == "contacts":
        override = arm(top='<option><flag override="enable"/></option>')
        with pytest.raises(MorphologyError, match="overrides the parameters of all contacts"):
            built(override, edit)
