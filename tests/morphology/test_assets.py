"""All edits on every MuJoCo model that Gymnasium ships."""

from __future__ import annotations

import os

import mujoco
import numpy as np
import pytest

from shapechanger.morphology import (
    AddLimb,
    AddSegment,
    Cut,
    Mass,
    Remove,
    Split,
    name_elements,
)
from tests.morphology.models import built, differing, mass, posed
from tests.morphology.scenes import ASSETS, asset_spec

_MODELS = sorted(name.removesuffix(".xml") for name in os.listdir(ASSETS) if name.endswith(".xml"))
_ELEMENTS = ("bodies", "joints", "geoms", "sites", "cameras", "actuators")


def _named(model: str) -> mujoco.MjSpec:
    spec = asset_spec(model)
    name_elements(spec)
    return spec


def _before(model: str) -> mujoco.MjModel:
    return built(_named(model), Mass("*", scale=1.0))


def _limbs(spec: mujoco.MjSpec) -> list[str]:
    return [b.name for b in spec.bodies[1:] if b.parent.parent is not None]


@pytest.mark.parametrize("model", _MODELS)
def test_all_names_are_unique(model: str) -> None:
    """Naming does not change the model."""
    spec = _named(model)
    for elements in _ELEMENTS:
        names = [element.name for element in getattr(spec, elements)]
        assert all(names)
        assert len({*names}) == len(names)
    if model != "half_cheetah":  # MuJoCo warns about the total mass of this one.
        assert differing(built(asset_spec(model)), built(spec)) == []


@pytest.mark.parametrize("model", _MODELS)
def test_every_limb_can_be_removed_copied_cut_split_and_extended(model: str) -> None:
    """The total mass changes as expected."""
    spec = _named(model)
    before = _before(model)
    for limb in _limbs(spec):
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
