"""Edits as values, and bodies as JSON."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from shapechanger.errors import MorphologyError, UnknownName
from shapechanger.morphology import (
    AddSegment,
    Cut,
    Gravity,
    Mass,
    Remove,
    Stretch,
    as_body,
    compile_body,
    from_json,
    to_json,
)
from tests.morphology.models import leg

BODY = (
    Stretch("shank_*", 2.0),
    Mass("torso", to=2.0),
    AddSegment("shin", "foot", (0.1, 0.0, -0.2), gear=3.0),
    Gravity((0.0, 0.0, -1.62), amount=0.5),
    Remove("tail"),
)


def test_a_body_round_trips_through_json() -> None:
    """Text, bytes, single objects and integers are accepted."""
    assert from_json(to_json(BODY)) == from_json(to_json(BODY).encode()) == BODY
    assert from_json('{"edit":"cut","body":"shin","keep":0.5}') == (Cut("shin", 0.5),)
    assert from_json('[{"edit":"stretch","body":"shin","factor":2}]') == (Stretch("shin", 2.0),)
    assert from_json("[]") == ()
    assert to_json(()) == "[]"


@pytest.mark.parametrize("kind", ["strech", "", None, 3, ["stretch"]])
def test_unknown_kinds_and_fields_are_refused(kind: object) -> None:
    with pytest.raises(UnknownName, match=r"No edit matches .* There are: .*gravity, lock, add"):
        from_json(json.dumps([{"edit": kind, "body": "shin"}]))
    with pytest.raises(UnknownName, match=r"Did you mean 'stretch'\?"):
        from_json('[{"edit":"strech"}]')
    with pytest.raises(UnknownName, match=r"No field of 'stretch' matches 'facter'\. Did you"):
        from_json('[{"edit":"stretch","body":"shin","facter":2}]')


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        *(
            (text, "A body must be a JSON list of edits: ")
            for text in ("", "{", "stretch", "[1,", b"\xff\xfe\x00", b"[\xc3\x28]", "[" * 100_000)
        ),
        ({"edit": "stretch", "body": "shin"}, "stretch: .*factor"),
        ({"edit": "stretch", "body": 3, "factor": 2}, "stretch: Expected `str`, got `int`"),
        ({"edit": "stretch", "body": "shin", "factor": 2, "axis": "w"}, "stretch: .*'w'"),
        ({"edit": "gravity", "to": [0, -9.81]}, "gravity: Expected `array` of length 3"),
        ({"edit": "gravity", "to": [0, 0, -300]}, "gravity: Gravity must be at most 250"),
        ({"edit": "mass", "element": "*"}, "mass: Mass needs either scale or to"),
    ],
)
def test_invalid_json_and_fields_are_refused(fields: Any, message: str) -> None:
    with pytest.raises(MorphologyError, match=message):
        from_json(json.dumps(fields) if isinstance(fields, dict) else fields)


@pytest.mark.parametrize("value", [3, None, [3], ["stretch"], Stretch, [Stretch], [b"[]"]])
def test_other_objects_are_refused(value: Any) -> None:
    with pytest.raises(
        MorphologyError, match=r"made of edits such as Stretch\('shank_\*', 1\.5\), "
    ):
        as_body(value)


def test_edits_are_values() -> None:
    edit = Stretch("thigh", 2.0)
    assert edit == Stretch("thigh", 2.0) != Stretch("shin", 2.0)
    assert len({edit, Stretch("thigh", 2.0)}) == 1
    assert repr(edit) == "Stretch(body='thigh', factor=2.0)"
    with pytest.raises(AttributeError):
        edit.factor = 3.0  # type: ignore[misc]


def test_numpy_numbers_are_values() -> None:
    stretch = Stretch("thigh", np.linspace(0.5, 2.0, 2)[0])
    assert stretch == Stretch("thigh", 0.5)
    assert to_json([stretch]) == to_json([Stretch("thigh", 0.5)])
    fall = Gravity(np.array([0.0, 0.0, -3.7]))  # type: ignore[arg-type]
    assert fall == Gravity((0.0, 0.0, -3.7))
    assert type(Mass("*", scale=np.float32(2.0)).scale) is float
    assert Stretch("thigh", np.int64(2)) == Stretch("thigh", 2.0)
    assert compile_body(leg(), [Stretch("thigh", np.float64(2.0))]).nbody == leg().compile().nbody
