"""Values and models that edits refuse, when they are made and when they are applied."""

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
    PlaceGeom,
    Radius,
    Remove,
    Split,
    StartHeight,
    Stiffness,
    Stretch,
    TotalMass,
)
from tests.morphology.models import ant, arm, built, gantry, leg, limb
from tests.morphology.test_path import ONE_OF_EACH

_VALUES: list[Any] = [Mass, Density, Gear, Damping, Stiffness, Friction]
_END = (0.0, 0.0, 1.0)
_EVERY: list[Edit] = [*ONE_OF_EACH, AddMotor("hip"), AddFreeJoint("trunk"), AddFloor()]


def _bounds(kind: Any) -> list[float]:
    """Return the numbers just outside the bounds of a field's type."""
    found: list[float] = []
    for part in (kind, *getattr(kind, "__args__", ())):
        for meta in getattr(part, "__metadata__", ()):
            ends = [(meta.ge, -1e-3), (meta.le, 1e-3), (meta.gt, 0.0), (meta.lt, 0.0)]
            found += [end + by * max(1.0, abs(end)) for end, by in ends if end is not None]
    return found


@pytest.mark.parametrize("edit", _EVERY, ids=lambda edit: type(edit).__name__)
def test_numbers_out_of_range_are_refused_when_the_edit_is_made(edit: Edit) -> None:
    """The message names the field, its range and the number; vectors need three finite numbers."""
    for field in msgspec.structs.fields(edit):
        text, bad = str(field.type), [math.nan, math.inf, -math.inf]
        wrong: list[Any] = [] if "float" not in text else [*bad, *_bounds(field.type)]
        if "tuple" in text:
            wrong = [*((number, 0.0, 1.0) for number in bad), (1.0, 2.0), (1.0,) * 4, (), 1]
        for value in wrong:
            message = (
                f"{field.name} of {type(edit).__name__}: Expected .*, got {re.escape(repr(value))}"
            )
            with pytest.raises(MorphologyError, match=message):
                type(edit)(**{**msgspec.structs.asdict(edit), field.name: value})


def test_the_bounds_are_those_that_are_documented() -> None:
    assert Gravity((0.0, 0.0, -250.0)).to[2] == -250.0
    for make in (
        *(lambda kind=kind, x=x: kind("a", x) for kind in (Stretch, Radius) for x in (9e-3, 101.0)),
        *(lambda kind=kind, x=x: kind("a", to=x) for kind in _VALUES for x in (-2e6, 2e6)),
        *(lambda x=x: Cut("a", x) for x in (9e-3, 1.001)),
        *(lambda x=x: Split("a", "b", x) for x in (0.0, 1.0)),
        *(lambda x=x: StartHeight("a", x) for x in (101.0, -101.0)),
        *(lambda x=x: TotalMass(x) for x in (0.0, 2e6)),
        lambda: AddFloor(-1.0),
        lambda: AddLimb("a", "_2", 1.0, 101.0),
    ):
        with pytest.raises(MorphologyError, match="Expected `float"):
            make()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        *(
            (lambda kind=kind, x=x: kind("*", **x), f"{kind.__name__} needs either scale or to")
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
        (lambda: JointRange("hip", 1.0, 1.0), "lower limit must be below the upper one"),
        (lambda: Gravity((200.0, 0.0, -200.0)), "Gravity must be at most 250 m/s², got 282.8"),
        (lambda: PlaceGeom("a", start=_END), "PlaceGeom needs a radius, two different ends"),
        (lambda: PlaceGeom("a", start=_END, radius=1.0), "PlaceGeom needs a radius, two different"),
        (lambda: PlaceGeom("a", _END, _END), "PlaceGeom needs a radius, two different ends"),
        (lambda: PlaceGeom("a"), "PlaceGeom needs a radius, two different ends"),
        (lambda: Mass("a", scale=np.array([1.0, 2.0])), "scale of Mass: Expected `float | null`"),  # type: ignore[arg-type]
        (lambda: Stretch(3, 2.0), "body of Stretch: Expected `str`, got `int`"),  # type: ignore[arg-type]
    ],
)
def test_values_that_do_not_fit_each_other_are_refused(
    make: Callable[[], Edit], message: str
) -> None:
    with pytest.raises(MorphologyError, match=message):
        make()


@pytest.mark.parametrize("edit", _EVERY, ids=lambda edit: type(edit).__name__)
def test_the_nearest_element_of_the_kind_is_suggested(edit: Edit) -> None:
    """Every kind of edit that names an element suggests the nearest name."""
    kinds = {AddFreeJoint: "trunk", StartHeight: "trunk", Gear: "actuator", Friction: "geom"}
    kinds |= {Damping: "joint", Stiffness: "joint"}
    names = [(n, v) for n, v in msgspec.structs.asdict(edit).items() if isinstance(v, str)]
    for field, value in names[:1]:
        wrong = msgspec.structs.replace(edit, **{field: f"{value}x"})
        near = "" if value == "*" else rf"\. Did you mean '{value}'\?"
        kind = kinds.get(type(edit), field if field in ("joint", "geom") else "body")
        with pytest.raises(UnknownName, match=rf"No {kind} matches '{re.escape(value)}x'{near}"):
            built(leg(), wrong)
    assert names or isinstance(edit, Gravity | TotalMass | AddFloor)


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
        *(
            (leg, JointRange("knee", lower=low), f"The range of 'knee' would be {low} to")
            for low in (0.0, 1.0)
        ),
        *(
            (
                lambda kinds=kinds: arm(f'<actuator><general joint="lower" {kinds}/></actuator>'),
                Gear("*", scale=2.0),
                "is an actuator whose gains have no common scale",
            )
            for kinds in ('gaintype="muscle" biastype="affine"', 'biastype="muscle"')
        ),
        *(
            (gantry, edit, "'y' is a slide without limits: give both")
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
            "'link' has a mass or inertia written out, so its density has",
        ),
        (
            lambda: limb(
                '<inertial pos="0 0 0" mass="2" diaginertia=".1 .1 .1"/><geom size=".1"/>'
            ),
            Density("link", scale=2.0),
            "'link' has a mass or inertia written out, so its density has",
        ),
        (leg, PlaceGeom("sole", (0.0, 0.0, 0.0), _END), "'sole' is not a capsule or cylinder"),
        (leg, PlaceGeom("trunk", radius=0.1), "'trunk' is not a sphere, capsule or cylinder"),
        (leg, AddMotor("*"), r"matches '\*' has a motor, or none matches"),
        (leg, AddFreeJoint("trunk"), "'trunk' is not fixed: it has the joint 'root'"),
        (leg, AddFloor(), "A new geom needs an unused name, got 'floor'"),
        (ant, StartHeight("aux_1", 1.0), r"No trunk matches 'aux_1'\..* There are: torso\."),
    ],
)
def test_what_a_model_cannot_have_is_refused_when_the_edit_is_applied(
    load: Any, edit: Edit, message: str
) -> None:
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
    with pytest.raises(MorphologyError, match=f"^{type(edit).__name__} would .* {what} off"):
        built(spec, edit)
    if what == "contacts":
        override = arm(top='<option><flag override="enable"/></option>')
        with pytest.raises(MorphologyError, match="overrides the parameters of all contacts"):
            built(override, edit)
