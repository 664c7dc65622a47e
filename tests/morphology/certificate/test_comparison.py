"""Differences between models, in words and numbers."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import mujoco
import numpy as np
import pytest

from shapechanger.morphology.certificate.changes import (
    Change,
    ModelNumbers,
    change,
    compare,
    grouped,
)
from shapechanger.morphology.certificate.numbers import moved_numbers
from tests.morphology.scenes import asset, asset_spec, everything


def _ant(edit: Callable[[mujoco.MjSpec], object]) -> mujoco.MjModel:
    spec = asset_spec("ant")
    edit(spec)
    return spec.compile()


def _longer(spec: mujoco.MjSpec) -> None:
    """Double all four shanks, as in the 2017 release."""
    for geom in spec.geoms:
        if "ankle" in geom.name:
            geom.fromto = 2.0 * geom.fromto


def _found(changes: tuple[Change, ...], quantity: str, element: str) -> Change:
    """Return the only change of a quantity of an element."""
    (item,) = [c for c in changes if (c.quantity, c.element) == (quantity, element)]
    return item


def test_equal_models_have_no_changes() -> None:
    """Comparing equal models gives an empty tuple."""
    assert compare(asset("ant"), asset("ant")) == ()
    assert compare(everything(), everything()) == ()


def test_longer_shanks_change_lengths_masses_and_inertias() -> None:
    """Direct and derived changes are listed, per segment and in total."""
    changes = compare(asset("ant"), _ant(_longer))
    length = _found(changes, "length", "ankle_1")
    assert (length.before, length.after) == pytest.approx((math.hypot(0.4, 0.4), 1.1314), rel=1e-3)
    assert length.unit == "m"
    mass = _found(changes, "mass", "ankle_1")
    assert mass.sentence == "ankle_1: mass 0.06759 kg -> 0.1245 kg (x1.84)"
    total = _found(changes, "total mass", "robot")
    assert (total.before, total.after) == pytest.approx((0.911, 1.138), abs=1e-3)
    inertia = _found(changes, "inertia", "ankle_1")
    assert isinstance(inertia.before, tuple)
    assert inertia.unit == "kg·m²"


def test_equal_changes_are_grouped() -> None:
    """Equal changes of several elements are one line."""
    lines = [item.sentence for item in grouped(compare(asset("ant"), _ant(_longer)))]
    assert "ankle_1, ankle_2, ankle_3, ankle_4: length 0.5657 m -> 1.131 m (x2)" in lines


def test_a_capsule_has_radius_and_length() -> None:
    changes = compare(
        asset("ant"), _ant(lambda s: setattr(s.geom("left_ankle_geom"), "size", [0.1, 0, 0]))
    )
    radius = _found(changes, "radius", "ankle_1")
    assert (radius.before, radius.after) == (0.08, 0.1)
    assert not [c for c in changes if c.quantity in ("length", "size")]


def test_other_shapes_have_a_size() -> None:
    """Sizes of spheres are listed as `size`."""
    changes = compare(
        asset("ant"), _ant(lambda s: setattr(s.geom("torso_geom"), "size", [0.3, 0, 0]))
    )
    size = _found(changes, "size", "torso_geom")
    assert size.sentence == "torso_geom: size 0.25 m -> 0.3 m (x1.2)"


def test_lengths_of_visual_geoms_explain_their_bodies() -> None:
    spec = asset_spec("inverted_pendulum")
    spec.geom("cpole").fromto = [0, 0, 0, 0.001, 0, 1.2]
    changes = compare(asset("inverted_pendulum"), spec.compile())
    length = _found(changes, "length", "pole")
    assert (length.before, length.after) == pytest.approx((0.6, 1.2), rel=1e-5)


def test_a_change_of_shape_is_a_change_of_type() -> None:
    """Type and size are listed instead of a length; a removed geom is listed as such."""

    def square(spec: mujoco.MjSpec) -> None:
        spec.geom("left_ankle_geom").type = mujoco.mjtGeom.mjGEOM_BOX

    changes = compare(asset("ant"), _ant(square))
    assert _found(changes, "type", "left_ankle_geom").after == "box"
    assert isinstance(_found(changes, "size", "left_ankle_geom").after, tuple)
    gone = compare(asset("ant"), _ant(lambda s: s.delete(s.geom("aux_1_geom"))))
    assert _found(gone, "geom", "aux_1_geom").sentence == "aux_1_geom: geom removed (capsule)"


def test_visual_geoms_alone_are_no_change() -> None:
    """A visual geom on an unchanged body is ignored."""
    xml = (
        "<mujoco><worldbody><body><joint/><inertial mass='1' pos='0 0 0' diaginertia='1 1 1'/>"
        "<geom type='capsule' size='.1 {}' contype='0' conaffinity='0'/></body>"
        "</worldbody></mujoco>"
    )
    models = [mujoco.MjModel.from_xml_string(xml.format(length)) for length in (0.2, 0.4)]
    assert compare(*models) == ()


def test_joint_ranges_are_in_degrees() -> None:
    """Ranges of hinges have the unit of the model's file."""
    changes = compare(asset("ant"), _ant(lambda s: setattr(s.joint("hip_1"), "range", [-24, 24])))
    (item,) = changes
    assert item.quantity == "joint range"
    assert item.unit == "deg"
    assert item.before == pytest.approx((-30.0, 30.0))
    assert item.after == pytest.approx((-24.0, 24.0))
    assert item.sentence == "hip_1: joint range (-30, 30) deg -> (-24, 24) deg (x0.8)"


def test_a_slide_has_other_units_than_a_hinge() -> None:
    """Slides have metres and N·s/m, hinges N·m·s/rad."""
    target = asset("inverted_pendulum")
    target.jnt_range[0] *= 2.0
    target.dof_damping[:] = 3.0
    changes = compare(asset("inverted_pendulum"), target)
    assert _found(changes, "joint range", "slider").unit == "m"
    assert _found(changes, "damping", "slider").unit == "N·s/m"
    assert _found(changes, "damping", "hinge").unit == "N·m·s/rad"


def test_a_removed_limit_is_none() -> None:
    """A field that one side lacks is None."""
    target = asset("ant")
    target.jnt_limited[1] = 0
    item = _found(compare(asset("ant"), target), "joint range", "hip_1")
    assert item.after is None
    assert item.sentence == "hip_1: joint range (-30, 30) deg -> none"
    back = _found(compare(target, asset("ant")), "joint range", "hip_1")
    assert back.before is None


def test_masked_friction_is_no_change() -> None:
    """Friction below that of the floor has no effect, as in two hopper tasks of ODRL."""
    slippery = _ant(lambda s: setattr(s.geom("left_ankle_geom"), "friction", [0.2, 0.5, 0.5]))
    assert compare(asset("ant"), slippery) == ()
    rough = _ant(lambda s: setattr(s.geom("left_ankle_geom"), "friction", [2.0, 0.5, 0.5]))
    (item,) = compare(asset("ant"), rough)
    assert item.quantity == "contact friction"
    assert item.sentence == "floor + left_ankle_geom: contact friction 1 each -> 2 each (x2)"


def test_gear_and_gravity_are_listed() -> None:
    target = asset("ant")
    target.actuator_gear[0, 0] = 75.0
    target.opt.gravity[2] = -4.905
    changes = compare(asset("ant"), target)
    assert [item.sentence for item in changes] == [
        "simulation: gravity (0, 0, -9.81) m/s² -> (0, 0, -4.905) m/s² (x0.5)",
        "hip_4: gear 150 -> 75 (x0.5)",
    ]


def test_added_and_removed_elements_are_listed() -> None:
    """A new segment adds a body, a joint, a geom, a contact and dimensions."""

    def extend(spec: mujoco.MjSpec) -> None:
        foot = spec.body("aux_1").bodies[0].add_body(name="foot", pos=[0.4, 0.4, 0])
        foot.add_joint(name="toe", axis=[0, 0, 1], range=[-10, 10])
        foot.add_geom(name="foot", size=[0.05, 0, 0], mass=0.5)
        spec.add_actuator(name="toe", target="toe", trntype=mujoco.mjtTrn.mjTRN_JOINT)

    changes = compare(asset("ant"), _ant(extend))
    assert _found(changes, "body", "foot").sentence == "foot: body added (0.5 kg)"
    assert _found(changes, "joint", "toe").sentence == "toe: joint added (hinge)"
    assert _found(changes, "actuator", "toe").after == "toe"
    assert _found(changes, "contact", "floor + foot").before is None
    assert _found(changes, "dimensions", "nq").sentence == "nq: dimensions 15 -> 16"
    assert (_found(changes, "dimensions", "nbody").after) == 15.0
    back = compare(_ant(extend), asset("ant"))
    assert _found(back, "body", "foot").sentence == "foot: body removed (0.5 kg)"
    assert _found(back, "body", "foot").after is None


def test_another_order_of_motors_is_a_change() -> None:
    source, target = asset("ant"), asset("ant")
    target.actuator_trnid[[0, 1]] = target.actuator_trnid[[1, 0]]
    for array in ("actuator_acc0", "actuator_length0"):
        values = getattr(target, array)
        values[[0, 1]] = values[[1, 0]]
    (item,) = compare(source, target)
    assert (item.quantity, item.element) == ("order", "actuators")
    assert isinstance(item.after, tuple)
    assert item.after[:2] == ("ankle_4", "hip_4")


def test_derived_constants_are_listed_only_when_alone() -> None:
    """Derived constants are listed only if nothing else explains them."""
    target = asset("ant")
    target.dof_M0[0] *= 2.0
    (item,) = compare(asset("ant"), target)
    assert (item.quantity, item.element) == ("derived constant", "dof_M0")
    target.opt.timestep = 0.005
    assert {item.quantity for item in compare(asset("ant"), target)} == {"timestep"}


def test_a_tendon_has_no_unit() -> None:
    """The coefficients of fixed tendons have no common unit."""
    target = everything()
    target.tendon_damping[:] = 5.0
    assert {item.unit for item in compare(everything(), target)} == {""}


def test_standing_heights_are_compared_if_both_are_given() -> None:
    """The caller passes the heights."""
    model = asset("ant")
    (item,) = compare(model, model, standing_height=(0.532, 1.017))
    assert item.sentence == "robot: standing height 0.532 m -> 1.017 m (x1.91)"
    assert compare(model, model, standing_height=(0.532, 0.532)) == ()
    assert compare(model, model, standing_height=(None, 1.0)) == ()


@pytest.mark.parametrize("seed", range(20))
def test_every_difference_is_listed(seed: int) -> None:
    """Changes are listed if and only if the effective models differ."""
    random = np.random.default_rng(seed)
    names = [
        name
        for name in dir(mujoco.MjModel)
        if name.startswith(("body_", "jnt_", "dof_", "geom_", "tendon_", "actuator_", "eq_", "opt"))
    ]
    target = everything()
    arrays = [
        array
        for name in names
        if isinstance(array := getattr(target, name), np.ndarray) and array.dtype == np.float64
    ]
    chosen = arrays[random.integers(len(arrays))]
    if chosen.size:
        chosen.flat[random.integers(chosen.size)] += 0.01
    same = moved_numbers(target) == moved_numbers(everything())
    assert (compare(everything(), target) == ()) == same


def test_digits_distinguish_the_numbers() -> None:
    """Enough digits are shown to tell the two numbers apart."""
    item = change("mass", "leg", (0.1,), (0.1 + 1e-7,), "kg")
    assert item.sentence == "leg: mass 0.1 kg -> 0.1000001 kg"
    tiny = change("mass", "leg", (0.1,), (math.nextafter(0.1, 1.0),), "kg")
    assert tiny.sentence.count("0.1000000000000000") == 2


def test_infinite_numbers_become_words() -> None:
    item = change("force range", "motor", (-math.inf, math.inf), (-1.0, 1.0))
    assert item.before == ("-inf", "inf")
    assert item.sentence == "motor: force range (-inf, inf) -> (-1, 1)"


@pytest.mark.parametrize(
    ("before", "after", "ratio"),
    [
        ((1.0, 2.0), (2.0, 4.0), " (x2)"),
        ((1.0, 2.0), (2.0, 5.0), ""),
        ((0.0,), (1.0,), ""),
        ((0.0, 1.0), (0.0, 3.0), " (x3)"),
        ((1.0, 2.0), (1.0,), ""),
        ((), (1.0,), ""),
        (("a",), ("b",), ""),
    ],
)
def test_a_common_ratio_is_shown(
    before: tuple[float, ...], after: tuple[float, ...], ratio: str
) -> None:
    """The ratio is shown if all nonzero numbers have the same one."""
    sentence = change("mass", "leg", before, after).sentence
    assert sentence.endswith(ratio)
    assert ("(x" in sentence) == bool(ratio)


def test_comparing_two_ants_is_fast() -> None:
    """A comparison takes about 10 ms, since sweeps make thousands."""
    source, target = asset("ant"), _ant(_longer)
    times = []
    for _ in range(5):
        start = time.process_time()
        compare(source, target)
        times.append(time.process_time() - start)
    assert min(times) < 0.1  # CPU seconds, with a margin of 10.


def test_another_height_explains_derived_constants() -> None:
    model = asset("ant")
    model.body_subtreemass[1] *= 2.0
    heights = (0.7, 1.4)
    (item,) = compare(asset("ant"), model, standing_height=heights)
    assert (item.quantity, item.before, item.after) == ("standing height", *heights)
    (alone,) = compare(asset("ant"), model)
    assert (alone.quantity, alone.element) == ("derived constant", "body_subtreemass")


@pytest.mark.parametrize("drawn", [False, True])
def test_stored_numbers_tell_how_a_model_changed(drawn: bool) -> None:
    moved, sensed, numbers = ModelNumbers.read(asset("ant"), drawn=drawn)
    assert ModelNumbers.read(asset("ant"), drawn=drawn) == (moved, sensed, numbers)
    other = ModelNumbers.read(_ant(_longer), drawn=drawn)
    assert other[0] != moved
    found = ModelNumbers.changes(numbers, other[2])
    assert any("mass 0.06759 kg -> 0.1245 kg (x1.84)" in sentence for sentence in found)
    assert ModelNumbers.changes(numbers, numbers) == ()
