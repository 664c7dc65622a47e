"""Differences between models, in words and numbers."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import mujoco
import pytest

from shapechanger.morphology.certificate.changes import Change, compare, fingerprint, grouped
from shapechanger.morphology.certificate.numbers import names_of
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


def _swap(spec: mujoco.MjSpec) -> None:
    spec.geom(_SHANK).friction = [2.0, 0.5, 0.5]
    spec.delete(spec.geom("aux_1_geom"))


def _extend(spec: mujoco.MjSpec) -> None:
    foot = spec.body("aux_1").bodies[0].add_body(name="foot", pos=[0.4, 0.4, 0])
    foot.add_joint(name="toe", axis=[0, 0, 1], range=[-10, 10])
    foot.add_geom(name="foot", size=[0.05, 0, 0], mass=0.5)
    foot.add_site(name="tip")
    spec.add_actuator(name="jet", target="tip", trntype=mujoco.mjtTrn.mjTRN_SITE)
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
        (
            _swap,
            [
                "aux_1_geom: geom removed (capsule)",
                "aux_1_geom + floor: contact removed (3)",
                f"floor + {_SHANK}: contact friction 1 each -> 2 each (x2)",
            ],
        ),
        (
            lambda s: setattr(s.joint("hip_1"), "range", [-24, 24]),
            ["hip_1: joint range (-30, 30) deg -> (-24, 24) deg (x0.8)"],
        ),
        (
            lambda s: setattr(s.joint("hip_1"), "limited", mujoco.mjtLimited.mjLIMITED_FALSE),
            ["hip_1: joint range (-30, 30) deg -> none"],
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
                "left_ankle_geom: position (0.2, 0.2, 0) m -> (0.4, 0.4, 0) m (x2)",
            ],
        ),
        (
            _extend,
            [
                "foot: body added (0.5 kg)",
                "toe: joint added (hinge)",
                "toe: actuator added (toe)",
                "floor + foot: contact added (3)",
                "nbody, nv: dimensions 14 -> 15 (x1.07)",
                "nq: dimensions 15 -> 16 (x1.07)",
                "tip: site added (there)",
            ],
        ),
        # Friction below the floor's has no effect, for example in two hopper tasks of ODRL.
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
    name = "inverted_pendulum"
    changed = _edited(lambda s: setattr(s.geom("cpole"), "fromto", [0, 0, 0, 0.001, 0, 1.2]), name)
    assert "pole: length 0.6 m -> 1.2 m (x2)" in {c.sentence for c in compare(asset(name), changed)}


def _resize(model: mujoco.MjModel, geom: str, **values: float) -> None:
    model.geom(geom).size[:] *= 1.5
    for field, value in values.items():
        getattr(model.geom(geom), field)[:] = value


@pytest.mark.parametrize(
    ("load", "write", "report"),
    [
        (
            lambda: asset("half_cheetah"),
            lambda m: _resize(m, "head", pos=0.0),
            "head: length 0.3 m -> 0.45 m (x1.5)\nhead: radius 0.046 m -> 0.069 m (x1.5)\n"
            "head: position (0.6, 0, 0.1) m -> 0 each m",
        ),
        (
            lambda: asset("ant"),
            lambda m: _resize(m, _SHANK, contype=0, conaffinity=0),
            f"{_SHANK}: geom removed (capsule)\nfloor + {_SHANK}: contact removed (3)",
        ),
        # A visual geom on an unchanged body is ignored.
        (lambda: asset("inverted_pendulum"), lambda m: _resize(m, "cpole"), ""),
        (
            lambda: asset("inverted_pendulum"),
            lambda m: (_resize(m, "cpole"), m.opt.gravity.fill(0.0)),
            "simulation: gravity (0, 0, -9.81) m/s² -> 0 each m/s²",
        ),
        (
            everything,
            lambda m: m.body_gravcomp.fill(0.0),
            "trunk: gravity compensation 0.1 -> none",
        ),
        # The field's largest number decides what counts as rounding, however small it is.
        (everything, lambda m: m.site("palm").pos.__setitem__(0, 4e-15), ""),
        (
            everything,
            lambda m: setattr(m.opt, "tolerance", 1e-18),
            "simulation: tolerance 1e-08 -> 1e-18 (x1e-10)",
        ),
    ],
)
def test_a_report_has_nothing_else(
    load: Callable[[], mujoco.MjModel], write: Callable[[mujoco.MjModel], object], report: str
) -> None:
    target = load()
    write(target)
    assert "\n".join(grouped(compare(load(), target))) == report


def test_a_length_needs_the_geom_in_both_models() -> None:
    changed = _edited(lambda s: s.delete(s.geom("uwaist")), "humanoid")
    found = compare(asset("humanoid"), changed)
    assert "uwaist: geom removed (capsule)" in [each.sentence for each in found]
    assert not {"length", "radius"} & {each.quantity for each in found}


def test_tolerances_are_relative() -> None:
    """A number is compared by its size, and the fingerprint distinguishes the same numbers."""
    for one, two, same in (
        *((1e-18, 2e-18, False), (math.nan, math.nan, True), (math.inf, math.inf, True)),
        *((6.0 - 4.9e-9, 6.0 + 4.9e-9, False), (1.0, 1.0 - 4e-10, True), (1.0, 1.000001, False)),
    ):
        models = everything(), everything()
        for model, value in zip(models, (one, two), strict=True):
            model.opt.impratio = value
        assert (compare(*models) == ()) == same
        assert (fingerprint(models[0]) == fingerprint(models[1])) == same


def test_noise_is_a_share_of_the_largest_number_of_a_field() -> None:
    """Infinite bounds and other empty numbers have no share in it."""
    for largest, number, counts in (
        *((math.inf, 1e-18, True), (1.0, 4e-15, False), (5.0, 2e-14, True), (5.0, 4e-15, False)),
    ):
        one, two = everything(), everything()
        for model, value in ((one, 0.0), (two, number)):
            model.jnt_range[:], model.jnt_range[2] = 0.0, (-largest, largest)
            model.jnt_range[3] = value
        assert (fingerprint(one) != fingerprint(two)) == counts
        if not counts or math.isinf(largest):
            assert (compare(one, two) != ()) == counts


@pytest.mark.parametrize(
    ("load", "array", "quantity", "element", "unit"),
    [
        (lambda: asset("inverted_pendulum"), "jnt_range", "joint range", "slider", "m"),
        (lambda: asset("inverted_pendulum"), "dof_armature", "armature", "slider", "kg"),
        (lambda: asset("inverted_pendulum"), "dof_damping", "damping", "hinge", "N·m·s/rad"),
        # The coefficients of fixed tendons have no common unit.
        (everything, "tendon_damping", "damping", "string", ""),
        (everything, "dof_damping", "damping", "root", ""),  # Of metres and angles.
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
    names = names_of(source)["actuators"]
    after = (names[1], names[0], *names[2:])
    assert item == Change("order", "actuators", tuple(names), after)


def test_derived_constants_are_listed_only_when_alone() -> None:
    """Derived constants are listed only if no other difference, such as a height, explains them."""
    target = asset("ant")
    target.dof_M0[0] *= 2.0
    before, after = (tuple(model.dof_M0.tolist()) for model in (asset("ant"), target))
    (item,) = compare(asset("ant"), target)
    assert item == Change("derived constant", "dof_M0", before, after)
    target.stat.meaninertia *= 2.0
    assert compare(asset("ant"), target)[1].element == "meaninertia"
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
        ((0.0, 1.0), (1.0, 3.0), "(0, 1) -> (1, 3)"),
        ((1.0, 2.0), (2.0, 4.0002), "(1, 2) -> (2, 4) (x2)"),
        ((1.0, 1.0), (1e-9, 2e-9), "1 each -> (1e-09, 2e-09)"),
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
