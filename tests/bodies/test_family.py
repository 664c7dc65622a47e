"""Families of bodies."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from shapechanger.bodies import Family
from shapechanger.errors import MorphologyError, UnknownName
from shapechanger.morphology import Mass, Stretch, to_json
from tests.morphology.models import LEG

FAMILY = Family("Leg", {"Leg": (), "LongLeg": (Stretch("thigh", 2.0),)}, {"knee": "calf"})


def test_bodies_are_found_by_name() -> None:
    """The first body is the unedited model."""
    assert FAMILY.body("Leg") == ()
    assert FAMILY.body("LongLeg") == (Stretch("thigh", 2.0),)


def test_an_unknown_name_is_refused() -> None:
    """The error names the family and the nearest body."""
    with pytest.raises(
        UnknownName, match=r"No body of the family Leg matches 'LongLegs'\. Did you"
    ):
        FAMILY.body("LongLegs")
    with pytest.raises(UnknownName, match="No body of the family Leg matches ''"):
        FAMILY.body("")


def test_bodies_can_be_edits_or_json() -> None:
    """Edits and JSON are accepted as well as names."""
    edits = (Stretch("thigh", 2.0), Mass("shin", scale=2.0))
    text = to_json(edits)
    for value in (edits, list(edits), iter(edits), text, f"  {text}\n"):
        assert FAMILY.body(value) == edits
    assert FAMILY.body(edits[0]) == edits[:1]
    assert FAMILY.body('{"edit":"stretch","body":"thigh","factor":2}') == edits[:1]


@pytest.mark.parametrize("value", ["[1]", "{}", "[", 3, None, ["LongLeg"]])
def test_invalid_bodies_are_refused(value: Any) -> None:
    """Other values raise MorphologyError."""
    with pytest.raises(MorphologyError):
        FAMILY.body(value)


def test_a_model_is_loaded_with_names(tmp_path: Path) -> None:
    """Elements have names from the file, the family, or defaults."""
    path = tmp_path / "leg.xml"
    path.write_text(LEG.replace('<body name="shin"', "<body"))
    for given in (path, str(path)):
        spec = FAMILY.load(given)
        assert [body.name for body in spec.bodies] == ["world", "trunk", "thigh", "calf"]
    plain = Family("Leg", {}).load(path)
    assert [body.name for body in plain.bodies] == ["world", "trunk", "thigh", "knee"]
