"""Differences between models, in words and numbers."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import mujoco
import pytest

from shapechanger.morphology.certificate.changes import Change, compare, grouped
from tests.morphology.scenes import asset, asset_spec, everything

_SHANK = "left_ankle_geom"


def _edited(edit: Callable[[mujoco.MjSpec], object], name: str = "ant") -> mujoco.MjModel:
    spec = asset_spec(name)
    edit(spec)
    return spec.compile()


def _longer(spec: mujoco.MjSpec) -> None:
    for geom in spec.geoms:
        if "ankle" in geom.name:
            geom.fromto = 2.0 * geom.fromto


def _extend(spec: mujoco.MjSpec) -> None:
    foot = spec.body("aux_1").bodies[0].add_body(name="foot", pos=[0.4, 0.4, 0])
    foot.add_joint(name="toe", axis=[0, 0, 1], range=[-10, 10])
    foot.add_geom(name="foot", size=[0.05, 0, 0], mass=0.5)
    spec.add_actuator(name="toe", target="toe", trntype=mujoco.mjtTrn.mjTRN_JOINT)


@pytest.mark.parametrize(
    ("edit", "sentences"),
    [
        (
            lambda s: setattr(s.geom(_SHANK), "size", [0.1, 0, 0]),
            ["ankle_1: radius 0.08 m -> 0.1 m (x1.25)"],
        ),
        (
            lambda s: setattr(s.geom("torso_geom"), "size", [0.3, 0, 0]),
            ["torso_geom: size 0.25 m -> 0.3 m (x1.2)"],
        ),
        (
            lambda s: setattr(s.geom(_SHANK), "type", mujoco.mjtGeom.mjGEOM_BOX),
            [f"{_SHANK}: type capsule -> box"],
        ),
        (lambda s: s.delete(s.geom("aux_1_geom")), ["aux_1_geom: geom removed (capsule)"]),
        (
            lambda s: setattr(s.joint("hip_1"), "range", [-24, 24]),
            ["hip_1: joint range (-30, 30) deg -> (-24, 24) deg (x0.8)"],
        ),
        (
            lambda s: setattr(s.joint("hip_1"), "limited", mujoco.mjtLimited.mjLIMITED_FALSE),
            ["hip_1: joint range (-30, 30) deg -> none"],
        ),
        (
            lambda s: setattr(s.geom(_SHANK), "friction", [2.0, 0.5, 0.5]),
            [f"floor + {_SHANK}: contact friction 1 each -> 2 each (x2)"],
        ),
        (
            lambda s: setattr(s.option, "gravity", [0, 0, -4.905]),
            ["simulation: gravity (0, 0, -9.81) m/s² -> (0, 0, -4.905) m/s² (x0.5)"],
        ),
        (
            lambda s: setattr(s.actuators[0], "gear", [75, 0, 0, 0, 0, 0]),
            ["hip_4: gear 150 -> 75 (x0.5)"],
        ),
        (
            _longer,
            [
                "ankle_1, ankle_2, ankle_3, ankle_4: mass 0.06759 kg -> 0.1245 kg (x1.84)",
                "ankle_1, ankle_2, ankle_3, ankle_4: length 0.5657 m -> 1.131 m (x2)",
                "robot: total mass 0.9109 kg -> 1.138 kg (x1.25)",
            ],
        ),
        (
            _extend,
            [
                "foot: body added (0.5 kg)",
                "toe: joint added (hinge)",
                "toe: actuator added (toe)",
                "floor + foot: contact added (3)",
                "nq: dimensions 15 -> 16 (x1.07)",
            ],
        ),
        # Friction below the floor's has no effect, as in two hopper tasks of ODRL.
        (lambda s: setattr(s.geom(_SHANK), "friction", [0.2, 0.5, 0.5]), []),
        (lambda _: None, []),
    ],
)
def test_a_difference_is_a_sentence(
    edit: Callable[[mujoco.MjSpec], object], sentences: list[str]
) -> None:
    """Each difference is a sentence, and comparing in reverse swaps before and after."""
    source, target = asset("ant"), _edited(edit)
    changes, back = compare(source, target), compare(target, source)
    found = grouped(changes)
    assert set(sentences) <= set(found)
    assert bool(found) == bool(sentences)
    mirrored = {(item.quantity, item.element, item.after, item.before) for item in back}
    assert mirrored == {(item.quantity, item.element, item.before, item.after) for item in changes}


def test_lengths_of_visual_geoms_explain_their_bodies() -> None:
    """A visual geom on an unchanged body is ignored."""
    name = "inverted_pendulum"
    changed = _edited(lambda s: setattr(s.geom("cpole"), "fromto", [0, 0, 0, 0.001, 0, 1.2]), name)
    assert "pole: length 0.6 m -> 1.2 m (x2)" in {c.sentence for c in compare(asset(name), changed)}
    drawn = asset(name)
    drawn.geom("cpole").size[:] *= 2.0
    assert compare(asset(name), drawn) == ()


@pytest.mark.parametrize(
    ("load", "array", "quantity", "element", "unit"),
    [
        (lambda: asset("inverted_pendulum"), "jnt_range", "joint range", "slider", "m"),
        (lambda: asset("inverted_pendulum"), "dof_armature", "armature", "slider", "kg"),
        (lambda: asset("inverted_pendulum"), "dof_damping", "damping", "hinge", "N·m·s/rad"),
        # The coefficients of fixed tendons have no common unit.
        (everything, "tendon_damping", "damping", "string", ""),
    ],
)
def test_units_are_those_of_the_kind_of_joint(
    load: Callable[[], mujoco.MjModel], array: str, quantity: str, element: str, unit: str
) -> None:
    """Numbers of slides are in m and N·s/m, of hinges in N·m·s/rad; tendons have no unit."""
    target = load()
    getattr(target, array)[:] += 3.0
    found = {(c.quantity, c.element): c.unit for c in compare(load(), target)}
    assert found[quantity, element] == unit


def test_another_order_of_motors_is_a_change() -> None:
    source, target = asset("ant"), asset("ant")
    for array in ("actuator_trnid", "actuator_acc0", "actuator_length0"):
        values = getattr(target, array)
        values[[0, 1]] = values[[1, 0]]
    (item,) = compare(source, target)
    assert item.sentence.startswith("actuators: order (hip_4, ankle_4, ")


def test_derived_constants_are_listed_only_when_alone() -> None:
    """Derived constants are listed only if no other difference, such as a height, explains them."""
    target = asset("ant")
    target.dof_M0[0] *= 2.0
    (item,) = compare(asset("ant"), target)
    assert (item.quantity, item.element) == ("derived constant", "dof_M0")
    (item,) = compare(asset("ant"), target, standing_height=(0.532, 1.017))
    assert item.sentence == "robot: standing height 0.532 m -> 1.017 m (x1.91)"
    assert compare(asset("ant"), asset("ant"), standing_height=(None, 1.0)) == ()
    target.opt.timestep = 0.005
    assert {item.quantity for item in compare(asset("ant"), target)} == {"timestep"}


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ((1.0, 2.0), (2.0, 4.0), "(1, 2) -> (2, 4) (x2)"),
        ((1.0, 2.0), (2.0, 5.0), "(1, 2) -> (2, 5)"),
        ((0.0,), (1.0,), "0 -> 1"),
        ((0.0, 1.0), (0.0, 3.0), "(0, 1) -> (0, 3) (x3)"),
        ((1.0, 2.0), (1.0,), "(1, 2) -> 1"),
        ((), (1.0,), "none -> 1"),
        (("a",), ("b",), "a -> b"),
        ((-math.inf, math.inf), (-1.0, 1.0), "(-inf, inf) -> (-1, 1)"),
        # Enough digits are shown to tell the two numbers apart.
        ((0.1,), (math.nextafter(0.1, 1.0),), "0.1 -> 0.10000000000000002"),
    ],
)
def test_numbers_are_shown_with_a_common_ratio(before: Any, after: Any, words: str) -> None:
    assert Change("mass", "leg", before, after).sentence == f"leg: mass {words}"
