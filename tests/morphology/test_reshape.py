"""`reshape` edits a copy and works on all models of Gymnasium; `compile_body` compiles it."""

from __future__ import annotations

import importlib
import json
import os
import re
import sys
from collections.abc import Callable

import mujoco
import numpy as np
import pytest

import shapechanger.morphology
from shapechanger.errors import BrokenModel, MissingExtra, MorphologyError, ShapechangerError
from shapechanger.morphology import (
    AddLimb,
    AddSegment,
    Cut,
    Density,
    Edit,
    Gear,
    Mass,
    Remove,
    Split,
    Stretch,
    compile_body,
    name_elements,
    reshape,
)
from tests.morphology.models import built, differing, gantry, leg, mass, posed
from tests.morphology.scenes import ASSETS, asset_spec
from tests.morphology.test_path import ONE_OF_EACH

_MISTAKES: list[tuple[Callable[[], mujoco.MjSpec], tuple[Edit, ...]]] = [
    (leg, (Stretch("thigh", 2.0), Remove("trunk"))),
    (leg, (Cut("thigh", 0.5), Gear("knee", scale=2.0))),
    (leg, (Density("thigh", to=0.0),)),
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
    edits = [Stretch("no such body", 2.0, amount=0.0), Remove("trunk", amount=0.0)]
    assert differing(built(leg()), compile_body(leg(), iter(edits))) == []


@pytest.mark.parametrize("edit", [Density("thigh", to=0.0), Mass("shin", to=1e-18)])
def test_a_body_that_does_not_compile_is_refused(edit: Edit) -> None:
    """The error contains the body as JSON and MuJoCo's reason."""
    with pytest.raises(BrokenModel) as caught:
        built(leg(), edit)
    message = str(caught.value)
    found = re.fullmatch(r"MuJoCo cannot compile the body (\[.*\]): ([^\n]*[^.\n])\.", message)
    assert found
    assert json.loads(found[1])[0]["edit"] == type(edit).__name__.lower()
    assert found[2].startswith("mass and inertia of moving bodies must be larger than mjMINVAL")
    assert isinstance(caught.value, MorphologyError)
    assert isinstance(caught.value.__cause__, ValueError | mujoco.FatalError)


_MODELS = sorted(name.removesuffix(".xml") for name in os.listdir(ASSETS) if name.endswith(".xml"))
_ELEMENTS = ("bodies", "joints", "geoms", "sites", "cameras", "actuators")


def _named(model: str) -> mujoco.MjSpec:
    spec = asset_spec(model)
    name_elements(spec)
    return spec


@pytest.mark.parametrize("model", _MODELS)
def test_all_names_are_unique(model: str) -> None:
    spec = _named(model)
    for elements in _ELEMENTS:
        names = [element.name for element in getattr(spec, elements)]
        assert all(names)
        assert len({*names}) == len(names)
    if model != "half_cheetah":  # MuJoCo warns about the total mass of this one.
        assert differing(built(asset_spec(model)), built(spec)) == []


@pytest.mark.parametrize("model", _MODELS)
def test_every_limb_can_be_removed_copied_cut_split_and_extended(model: str) -> None:
    spec = _named(model)
    before = built(spec, Mass("*", scale=1.0))
    for limb in [body.name for body in spec.bodies[1:] if body.parent.parent is not None]:
        subtree = float(before.body(limb).subtreemass[0])
        assert mass(built(spec, Remove(limb))) == pytest.approx(mass(before) - subtree, abs=1e-9)
        copied = built(spec, AddLimb(limb, "_copy", 0.5))
        assert mass(copied) == pytest.approx(mass(before) + subtree)
        if not any(geom.type in _LONG for geom in spec.body(limb).geoms):
            continue
        assert mass(built(spec, Cut(limb, 0.5))) < mass(before)
        split = built(spec, Split(limb, "half", axis=(0.0, 1.0, 0.0)).partly(1e-9))
        assert mass(split) == pytest.approx(mass(before))
        np.testing.assert_allclose(
            [posed(split).body(b.name).xpos for b in spec.bodies[1:]],
            posed(before).xpos[1:],
            atol=1e-9,
        )
        grown = built(spec, AddSegment(limb, "tip", (0.0, 0.0, 0.1), axis=(0.0, 1.0, 0.0)))
        assert grown.nbody == before.nbody + 1


_LONG = (mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_CYLINDER)


def test_the_extra_that_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(MissingExtra, match=r"pip install 'shapechanger\[sim\]'"):
        importlib.reload(shapechanger.morphology)
