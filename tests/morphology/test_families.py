"""Families of bodies."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import gymnasium as gym
import pytest

from shapechanger.envs.ant import ANT
from shapechanger.envs.runners import HOPPER
from shapechanger.errors import MorphologyError, UnknownName
from shapechanger.morphology import AddLimb, AddSegment, Body, Cut, Stretch, compile_body, to_json
from shapechanger.morphology.certificate import certify
from shapechanger.morphology.families import Family
from tests.morphology.models import LEG

FAMILY = Family("Leg", {"Leg": (), "LongLeg": (Stretch("thigh", 2.0),)}, {"knee": "calf"})


def test_bodies_are_found_by_name() -> None:
    assert FAMILY.body("Leg") == ()
    assert FAMILY.body("LongLeg") == (Stretch("thigh", 2.0),)
    with pytest.raises(
        UnknownName, match=r"No body of the family Leg matches 'LongLegs'\. Did you"
    ):
        FAMILY.body("LongLegs")


def test_a_model_is_loaded_with_names(tmp_path: Path) -> None:
    path = tmp_path / "leg.xml"
    path.write_text(LEG.replace('<body name="shin"', "<body"))
    for given in (path, str(path)):
        spec = FAMILY.load(given)
        assert [body.name for body in spec.bodies] == ["world", "trunk", "thigh", "calf"]
    plain = Family("Leg", {}).load(path)
    assert [body.name for body in plain.bodies] == ["world", "trunk", "thigh", "knee"]


def test_samples_repeat_and_grow() -> None:
    assert ANT.sample(5, 3) == ANT.sample(9, 3)[:5]
    assert ANT.sample(5, 3) != ANT.sample(5, 4)
    splits = ("train", "interpolation", "extrapolation", "composition")
    drawn = [body for split in splits for body in ANT.sample(8, 0, split)]
    assert len(set(map(to_json, drawn))) == len(drawn)


def _values(body: Body) -> dict[str, float]:
    edits = set(map(to_json, ([edit] for edit in body)))
    found = {}
    for axis in ANT.axes:
        named = [edit for edit in body if type(edit) is type(axis.edit(1.0))]
        for edit in named:
            value = getattr(edit, "factor", None) or getattr(edit, "scale", None)
            if value is not None and to_json([axis.edit(value)]) in edits:
                found[axis.name] = value
    return found


@pytest.mark.parametrize("split", ["train", "interpolation", "extrapolation", "composition"])
def test_splits_keep_to_their_ranges(split: Any) -> None:
    """Only extrapolation leaves the training ranges, and only composition combines parts."""
    outside, parts = [], []
    for body in ANT.sample(24, 0, split):
        values = _values(body)
        assert set(values) == {axis.name for axis in ANT.axes}
        assert all(a.lowest <= values[a.name] <= a.highest for a in ANT.axes)
        outside.append(any(not a.low <= values[a.name] <= a.high for a in ANT.axes))
        parts.append(sum(isinstance(edit, Cut | AddSegment) for edit in body))
    assert set(outside) == {split == "extrapolation"}
    assert (min(parts) >= 2) if split == "composition" else (set(parts) == {0, 1})


@pytest.mark.parametrize(
    ("env", "split"),
    [("Ant", "composition"), ("HalfCheetah", "composition"), ("Walker2d", "extrapolation")],
)
def test_drawn_bodies_compile_stand_and_differ(env: str, split: str) -> None:
    """Each body compiles, stands, and is certified to differ from the unedited body."""
    with gym.make(f"shapechanger/{env}-v1") as own:
        inner: Any = own.unwrapped
        for body in inner.drawn_bodies(4, 1, split):
            with gym.make(f"shapechanger/{env}-v1", body=body) as drawn:
                assert cast("Any", drawn.unwrapped).standing_height > 0.1
                assert certify(cast("Any", own), cast("Any", drawn)).changes


def test_what_cannot_be_drawn_is_refused() -> None:
    with pytest.raises(MorphologyError, match=r"friction .* lies between 0.45 and 2 \[1\], got 3"):
        ANT.body_at({"friction": 3.0})
    with pytest.raises(UnknownName, match=r"axis of the family Ant matches 'frictoin'. Did you"):
        ANT.body_at({"frictoin": 1.0})
    with pytest.raises(UnknownName, match="place of the family Ant matches 'leg 5'"):
        ANT.body_at({}, {"leg 5": "stump"})
    with pytest.raises(UnknownName, match=r"part of leg 1 .* matches 'wheel'"):
        ANT.body_at({}, {"leg 1": "wheel"})
    with pytest.raises(UnknownName, match="split matches 'test'"):
        ANT.sample(1, 0, cast("Any", "test"))
    with pytest.raises(MorphologyError, match="The family Leg declares no axes"):
        FAMILY.sample(1)
    with pytest.raises(MorphologyError, match="Hopper declares no parts at two places to draw"):
        HOPPER.sample(1, 0, "composition")


def test_a_rig_comes_before_the_edits_of_every_body(tmp_path: Path) -> None:
    path = tmp_path / "leg.xml"
    path.write_text(LEG)
    family = Family("TwoLegs", {"TwoLegs": ()}, rig=(AddLimb("thigh", "_2", 1.0),))
    assert family.load(path).compile().nu == 4
    assert compile_body(family.load(path), (Cut("thigh_2", 0.5),)).nu == 3
