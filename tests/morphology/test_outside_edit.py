"""An edit and a family that another package defines in one file, without registration."""

from __future__ import annotations

import importlib
import json
import sys
from pathlib import Path
from typing import Any

import gymnasium as gym
import pytest

import shapechanger  # noqa: F401  # Registers the ids.
from shapechanger.errors import MorphologyError, UnknownName
from shapechanger.morphology import (
    EDITS,
    Edit,
    Stretch,
    compile_body,
    from_json,
    interpolate,
    to_json,
)
from shapechanger.morphology.certificate import compare
from tests.morphology.models import LEG, built, leg

_FILE = '''
"""Softer feet, and the legs that have them."""

from functools import partial

from shapechanger.errors import MorphologyError
from shapechanger.morphology import Edit, Remove
from shapechanger.morphology.edits import part_of_the_way
from shapechanger.morphology.families import Axis, Family, length_axes
from shapechanger.morphology.spec import select


class Soften(Edit, frozen=True):
    geom: str
    margin: float

    def check(self):
        if not 0.0 <= self.margin < 1.0:
            raise MorphologyError(f"A margin must be below 1 m, got {self.margin}.")

    def apply(self, spec):
        for geom in select("geom", self.geom, spec.geoms):
            geom.margin = part_of_the_way(geom.margin, self.margin, self.amount)


LEGS = Family(
    "SoftLeg",
    {"SoftLeg": (Soften("sole", 0.1),)},
    axes=(
        *length_axes(["thigh"], 0.8, 1.2),
        Axis("softness", partial(Soften, "*"), 0.01, 0.1, 0.001, 0.5, "m"),
    ),
    parts={"knee": {"stump": (Remove("shin"),)}},
)
'''


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "outside_edit.py").write_text(_FILE, encoding="utf-8")
    monkeypatch.delitem(sys.modules, "outside_edit", raising=False)
    monkeypatch.delitem(EDITS, "soften", raising=False)
    return importlib.import_module("outside_edit")


def test_an_edit_of_another_package_works_like_a_built_in_edit(module: Any) -> None:
    """The edit has JSON and an amount, can be interpolated and certified, and works in an env."""
    edit = module.Soften("sole", 0.2)
    assert json.loads(to_json([edit])) == [{"edit": "soften", "geom": "sole", "margin": 0.2}]
    assert from_json(to_json([edit])) == (edit,)
    assert built(leg(), edit.partly(0.5)).geom("sole").margin[0] == 0.1
    assert interpolate((edit,), (Stretch("shin", 2.0),), 0.25)[0] == edit.partly(0.75)
    found = {item.quantity for item in compare(built(leg()), built(leg(), edit))}
    assert found == {"contact margin"}
    body = '[{"edit":"soften","geom":"*_ankle_geom","margin":0.3}]'
    with gym.make("shapechanger/Ant-v1", body=body) as env:
        inner: Any = env.unwrapped
        assert inner.model.geom("left_ankle_geom").margin[0] == 0.3
    with pytest.raises(UnknownName, match="No field of 'soften' matches 'margn'"):
        from_json('[{"edit":"soften","geom":"sole","margn":0.2}]')
    with pytest.raises(MorphologyError, match="soften: A margin must be below 1 m, got 2"):
        from_json('[{"edit":"soften","geom":"sole","margin":2}]')


def test_bodies_are_drawn_from_a_family_of_another_package(module: Any, tmp_path: Path) -> None:
    """An axis of the family uses an edit of the same package."""
    path = tmp_path / "leg.xml"
    path.write_text(LEG, encoding="utf-8")
    family = module.LEGS
    spec = family.load(path)
    assert compile_body(spec, family.body("SoftLeg")).geom("sole").margin[0] == 0.1
    for body in family.sample(6, 0, "extrapolation"):
        assert from_json(to_json(body)) == body
        model = compile_body(spec, body)
        assert 0.001 <= model.geom("thigh").margin[0] <= 0.5
    assert {compile_body(spec, body).nbody for body in family.sample(12)} == {3, 4}


def test_a_name_belongs_to_one_edit(module: Any, tmp_path: Path) -> None:
    """A module may be imported again; another class with the name of an edit is refused."""
    before = module.Soften
    again = importlib.reload(module)
    assert again.Soften is not before
    assert type(from_json('[{"edit":"soften","geom":"sole","margin":0.2}]')[0]) is again.Soften

    def apply(self: Edit, spec: object) -> None:
        del self, spec

    for name, tag in (("Stretch", "stretch"), ("Soften", "soften")):
        parts: Any = {"apply": apply, "__annotations__": {}, "__module__": __name__}
        kind: Any = type(Edit)
        with pytest.raises(MorphologyError, match=f"an edit '{tag}' already: give {name} a new"):
            kind(name, (Edit,), parts | {"__qualname__": f"elsewhere.{name}"}, frozen=True)
    with pytest.raises(MorphologyError, match="There is an edit 'cut' already"):
        kind("Cut", (Edit,), parts | {"__qualname__": "Cut"}, frozen=True)
    names = {"__module__": "copied", "__qualname__": "Soften"}
    copied = kind("Soften", (Edit,), parts | names, frozen=True)
    assert EDITS["soften"] is copied


def test_base_classes_are_no_edits() -> None:
    before = dict(EDITS)

    class TwoWords(Edit, frozen=True):
        pass

    class _Private(TwoWords, frozen=True):
        def apply(self, spec: object) -> None:
            del spec

    assert before == EDITS
    assert (TwoWords.__struct_config__.tag, _Private().partly(0.5).amount) == ("two_words", 0.5)
