"""What edits refuse when they are made, and when they are applied."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

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
from tests.morphology.models import ant, built, gantry, leg, limb, spec_of

_VALUES: list[Any] = [Mass, Density, Gear, Damping, Stiffness, Friction]
# Numbers that no ratio is.
_ABSURD = (0.0, -1.0, math.nan, math.inf, -math.inf, 1e-3, 1e3)
_END = (0.0, 0.0, 1.0)
_VECTOR = "must be a tuple of three finite numbers"
_HINGES: list[tuple[dict[str, Any], str]] = [
    ({"lower": 1.0, "upper": 1.0}, "A hinge needs a lower limit below its upper one, got 1.0"),
    ({"lower": math.nan}, "A hinge needs a lower limit below its upper one"),
    ({"upper": math.inf}, "A hinge needs a lower limit below its upper one"),
    ({"gear": 0.0}, "A motor needs a gear that is not zero, got 0.0"),
    ({"gear": math.nan}, "A motor needs a gear that is not zero, got nan"),
    ({"axis": (0.0, 0.0, 0.0)}, "The axis of a hinge must not be zero"),
    ({"axis": (1.0, 0.0)}, f"The axis of a hinge {_VECTOR}"),
]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        *(
            (lambda x=x: Stretch("thigh", x), "The factor of a stretch must be a ratio")
            for x in _ABSURD
        ),
        *(
            (lambda x=x: Radius("thigh", x), r"must be a ratio between 0\.01 and 100")
            for x in _ABSURD
        ),
        *((lambda x=x: Cut("thigh", x), "cut") for x in (*_ABSURD, 1.001)),
        *((lambda x=x: AddLimb("a", "_2", 1.0, x), "The size of a limb must be") for x in _ABSURD),
        *(
            (
                lambda kind=kind, x=x: kind("*", scale=x),
                f"The scale of {kind.__name__} must be a ratio",
            )
            for kind in _VALUES
            for x in _ABSURD
        ),
        *(
            (lambda kind=kind, x=x: kind("*", to=x), f"{kind.__name__} cannot be {x}")
            for kind in _VALUES
            for x in (math.nan, math.inf, -math.inf, 2e6)
        ),
        *(
            (lambda kind=kind, x=x: kind("*", to=x), f"{kind.__name__} cannot be {x}")
            for kind, x in (
                *((Mass, 0.0), (Mass, -1.0), (Density, -1.0), (Damping, -1.0)),
                *((Stiffness, -1.0), (Friction, -0.1), (Gear, 0.0)),
            )
        ),
        *(
            (
                lambda kind=kind, x=x: kind("*", **x),
                f"{kind.__name__} takes either scale or to, got",
            )
            for kind in _VALUES
            for x in ({}, {"scale": 2.0, "to": 3.0})
        ),
        *(
            (lambda x=x: Stretch("thigh", 2.0, amount=x), "amount must be between 0 and 1, got")
            for x in (-0.1, 1.1, math.nan, math.inf)
        ),
        *(
            (lambda x=x: Split("thigh", "toe", at=x), "A segment is split between 0 and 1, got")
            for x in (0.0, 1.0, -0.5, 1.5, math.nan, math.inf)
        ),
        *((lambda wrong=wrong: Split("a", "b", **wrong), message) for wrong, message in _HINGES),
        *(
            (lambda wrong=wrong: AddSegment("a", "b", _END, **wrong), message)
            for wrong, message in _HINGES
        ),
        *(
            (lambda x=x: AddSegment("shin", "foot", x), "The end of a segment must")
            for x in ((0.0, 0.0, 0.0), (math.nan, 0.0, 1.0), (0.0, 1.0))
        ),
        *(
            (lambda x=x: AddSegment("a", "b", _END, radius=x), "A radius must be above zero, got")
            for x in (0.0, -0.1, math.nan, math.inf)
        ),
        *(
            (lambda x=x: AddLimb("thigh", *x), "A copied limb needs a suffix and a finite angle")
            for x in (("", 1.0), ("_2", math.nan), ("_2", math.inf))
        ),
        *(
            (lambda x=x: JointRange("hip", *x), "needs a finite lower or upper limit")
            for x in ((None, None), (math.nan, 1.0), (0.0, math.inf))
        ),
        *(
            (lambda x=x: JointRange("hip", *x), "lower limit must be below the upper one")
            for x in ((1.0, 1.0), (2.0, 1.0))
        ),
        *((lambda x=x: Lock("hip", x), "cannot be locked at") for x in (math.nan, math.inf)),
        *(
            (lambda x=x: Gravity(x), f"Gravity {_VECTOR}")
            for x in (
                *((math.nan, 0.0, 1.0), (0.0, math.inf, 1.0), (1.0, 2.0), (1.0, 2.0, 3.0, 4.0), ()),
                [1.0, 2.0, 3.0],  # Lists are mutable, and would not equal the tuples from JSON.
            )
        ),
        (lambda: Gravity((0.0, 0.0, -251.0)), "Gravity is at most 250 m/s², got 251"),
        (lambda: Gravity((200.0, 0.0, -200.0)), "Gravity is at most 250 m/s², got 282.8"),
        *(
            (lambda x=x: StartHeight("trunk", x), "A start height is at most 100 m")
            for x in (math.nan, math.inf, 1e300)
        ),
        (lambda: AddMotor("a", 0.0), "a gear that is not zero"),
        (lambda: AddMotor("a", math.nan), "a gear that is not zero"),
        (lambda: AddFloor(friction=-1.0), "a finite height and friction"),
        (lambda: AddFloor(height=math.inf), "a finite height and friction"),
        (lambda: PlaceBody("a", (0.0, math.nan, 0.0)), f"The place of a body {_VECTOR}"),
        (lambda: PlaceGeom("a", middle=(0.0, 1.0)), f"The middle of a geom {_VECTOR}"),  # type: ignore[arg-type]
        (lambda: PlaceGeom("a", start=_END), "An axis has a start and an end, got"),
        (lambda: PlaceGeom("a", _END, _END), "by two different ends or by its middle"),
        (lambda: PlaceGeom("a"), "PlaceGeom takes two ends, a middle or a radius"),
        *(
            (lambda x=x: PlaceGeom("a", radius=x), "A radius must be above zero, got")
            for x in (0.0, -1.0, math.nan, math.inf)
        ),
        *(
            (lambda x=x: TotalMass(x), "A robot cannot have a mass of")
            for x in (0.0, -1.0, math.nan, 2e6)
        ),
    ],
)
def test_numbers_out_of_range_are_refused_when_the_edit_is_made(
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


def test_several_numbers_for_one_are_refused() -> None:
    """An array where a number belongs gets a sentence, not a TypeError."""
    with pytest.raises(MorphologyError, match=r"wrong type in Mass\(element='thigh'"):
        Mass("thigh", scale=np.array([1.0, 2.0]))  # type: ignore[arg-type]
