"""Application of edits to a copy, and compilation."""

from __future__ import annotations

import json
import re
from collections.abc import Callable

import mujoco
import pytest

from shapechanger.errors import BrokenModel, MorphologyError, ShapechangerError
from shapechanger.morphology import (
    AddLimb,
    Cut,
    Density,
    Edit,
    Gear,
    JointRange,
    Lock,
    Mass,
    Remove,
    Split,
    Stretch,
    compile_body,
    reshape,
)
from tests.morphology.models import built, differing, gantry, leg
from tests.morphology.test_path import ONE_OF_EACH

_MISTAKES: list[tuple[Callable[[], mujoco.MjSpec], tuple[Edit, ...]]] = [
    (leg, (Stretch("thigh", 2.0), Stretch("thgih", 2.0))),
    (leg, (Stretch("thigh", 2.0), Remove("trunk"))),
    (leg, (Stretch("thigh", 2.0), Split("shin", "thigh"))),
    (leg, (Cut("thigh", 0.5), Gear("knee", scale=2.0))),
    (leg, (JointRange("knee", lower=1.0),)),
    (leg, (Density("thigh", to=0.0),)),
    (gantry, (Lock("yaw"), Lock("yaw"))),
    (gantry, (AddLimb("boom", "_2", 1.0), AddLimb("boom", "_2", 1.0))),
]


@pytest.mark.parametrize("edit", ONE_OF_EACH, ids=lambda x: type(x).__name__)
def test_the_given_spec_is_unchanged(edit: Edit) -> None:
    spec = leg()
    text, before = spec.to_xml(), built(leg())
    reshape(spec, [edit])
    assert spec.to_xml() == text
    assert differing(before, built(spec)) == []


@pytest.mark.parametrize(("load", "edits"), _MISTAKES)
def test_the_given_spec_is_unchanged_after_an_error(
    load: Callable[[], mujoco.MjSpec], edits: tuple[Edit, ...]
) -> None:
    """Edits before the failing one have no effect either."""
    spec = load()
    text = spec.to_xml()
    with pytest.raises(ShapechangerError):
        compile_body(spec, edits)
    assert spec.to_xml() == text
    assert differing(built(load()), built(spec)) == []


def test_edits_with_amount_0_are_skipped() -> None:
    """Even their names are not looked up."""
    edits = [Stretch("no such body", 2.0, amount=0.0), Remove("trunk", amount=0.0)]
    assert differing(built(leg()), compile_body(leg(), iter(edits))) == []


@pytest.mark.parametrize(
    ("edit", "reason"),
    [
        (
            Density("thigh", to=0.0),
            "mass and inertia of moving bodies must be larger than mjMINVAL",
        ),
        (Mass("shin", to=1e-18), "mass and inertia of moving bodies must be larger than mjMINVAL"),
    ],
)
def test_a_body_that_does_not_compile_is_refused(edit: Edit, reason: str) -> None:
    """The error has the body as JSON and MuJoCo's reason."""
    with pytest.raises(BrokenModel) as caught:
        built(leg(), edit)
    message = str(caught.value)
    found = re.fullmatch(r"MuJoCo does not compile the body (\[.*\]): ([^\n]*[^.\n])\.", message)
    assert found
    assert json.loads(found[1])[0]["edit"] == type(edit).__name__.lower()
    assert found[2].startswith(reason)
    assert isinstance(caught.value, MorphologyError)
    assert isinstance(caught.value.__cause__, ValueError | mujoco.FatalError)
