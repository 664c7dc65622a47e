"""The table of the numbers that decide a model's motion, and the fingerprint of all of them."""

from __future__ import annotations

import copy
import functools
import re
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
import pytest

from shapechanger.morphology.certificate import compare, fingerprint
from shapechanger.morphology.certificate.changes import fingerprints
from shapechanger.morphology.certificate.numbers import (
    MOVED,
    TABLE,
    Field,
    Numbers,
    made_arrays,
    moved_numbers,
    names_of,
)
from shapechanger.morphology.spec import name_elements
from tests.models import xml
from tests.morphology.scenes import EVERYTHING, asset, asset_spec, everything

_CLOTH = """
<mujoco>
  <option><flag override="enable" sleep="enable"/></option>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 1" pos="0 0 -.1"/>
    <flexcomp name="cloth" type="grid" count="3 3 1" spacing=".1 .1 .1" pos="0 0 1" dim="2"
              radius=".01" mass="1"><edge equality="true"/></flexcomp>
  </worldbody>
</mujoco>
"""

# Springs that yield, a moving belt, a delayed motor, and other things that few models have.
_RARE = xml("rare")


@functools.cache
def _compiled(text: str) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(text)


def _rare() -> mujoco.MjModel:
    return copy.copy(_compiled(_RARE))


def _cloth() -> mujoco.MjModel:
    return copy.copy(_compiled(_CLOTH))


@functools.cache
def _nominal(load: Callable[[], mujoco.MjModel]) -> tuple[mujoco.MjModel, Numbers, str]:
    """Return a model, its numbers and its fingerprint; callers must not change them."""
    model = load()
    return model, moved_numbers(model), fingerprint(model)


def _array(model: mujoco.MjModel, name: str) -> Any:
    """Return an array of a model or of its options; None for a computed array."""
    if name.startswith("opt_"):
        found = getattr(model.opt, name.removeprefix("opt_"), None)
        return None if found is None else np.asarray(found)
    return getattr(model, name, None)


def _write(model: mujoco.MjModel, field: Field, rows: Any = slice(None)) -> None:
    new = np.array(_array(model, field.array))
    if field.array.startswith("opt_") and new.ndim == 0:
        setattr(model.opt, field.array.removeprefix("opt_"), new * 1.1 if new % 1 else new + 1)
        return
    old = new[rows]
    if new.dtype.kind == "b":
        new[rows] = ~old
    elif new.dtype.kind == "f":
        new[rows] = np.where(old != 0, old * 1.1, 0.01)
    else:
        new[rows] = old + 1
    _array(model, field.array)[:] = new


# Numbers of the table that are an array of MuJoCo; the others are computed from several arrays.
_WRITTEN = [
    (section, quantity, field)
    for section, fields in MOVED.items()
    for quantity, field in fields.items()
    if not field.of and field.array and _array(everything(), field.array) is not None
]


# mutmut selects tests by id, which fails if the id contains the text of a field.
@pytest.mark.parametrize(
    ("section", "quantity", "field"), _WRITTEN, ids=[" ".join(one[:2]) for one in _WRITTEN]
)
def test_a_number_counts_where_the_table_says_so_and_nowhere_else(
    section: str, quantity: str, field: Field
) -> None:
    """Writing to an array changes the elements that list its quantity, and the fingerprint."""
    listed = 0
    for load in (everything, _cloth, _rare):
        nominal, before, mark = _nominal(load)
        model = load()
        _write(model, field)
        after = moved_numbers(model)[section]
        found = [
            element
            for element, fields in before[section].items()
            if quantity in fields and quantity in after.get(element, {})
        ]
        for element in found:
            assert after[element][quantity] != before[section][element][quantity]
        if found:
            listed += 1
            assert fingerprint(model) != mark
            assert compare(nominal, model)
        mask = made_arrays(nominal).get(field.where)
        values = _array(nominal, field.array)
        if mask is None or values.ndim == 0 or len(mask) != len(values):
            continue
        ignored, model = ~np.asarray(mask).astype(bool), load()
        _write(model, field, ignored)
        if np.array_equal(made_arrays(model)[field.where], mask):  # The write kept the mask.
            assert moved_numbers(model)[section] == before[section]
    assert listed


# Arrays on which computed or masked numbers of the table depend, and the row to write to.
_MADE = {
    **dict.fromkeys(("body_gravcomp", "body_invweight0", "body_subtreemass", "geom_rbound"), 4),
    **{"dof_M0": 3, "dof_invweight0": 3, "geom_contype": 3, "geom_conaffinity": 8},
    **{"jnt_limited": 2, "eq_obj1id": 2, "wrap_prm": -1},
    **{f"geom_{name}": 0 for name in ("friction", "solref", "solimp", "condim", "margin", "gap")},
    **{f"pair_{name}": 0 for name in ("friction", "solref", "solimp", "dim", "margin", "gap")},
    **{f"tendon_{name}": 0 for name in ("limited", "length0", "invweight0", "actfrclimited")},
    **{
        f"actuator_{name}": 0
        for name in ("trnid", "ctrllimited", "forcelimited", "length0", "acc0")
    },
    **dict.fromkeys(("mesh_vert", "hfield_data", "hfield_size"), 0),
    **{"exclude_signature": 0, "wrap_objid": 0},
}
# Zero switches these off; the others become larger.
_OFF = ("limited", "contype", "conaffinity", "signature")


@pytest.mark.parametrize("array", _MADE)
def test_each_array_behind_a_number_changes_the_fingerprint(array: str) -> None:
    model = everything()
    values, row = getattr(model, array), _MADE[array]
    if array.endswith("dim"):
        values[row] *= 2
    elif array.endswith(_OFF) and np.all(values[row]):
        values[row] = 0
    else:
        values[row] = values[row] * 1.01 + 0.1 if values.dtype.kind == "f" else values[row] + 1
    assert fingerprint(model) != fingerprint(everything())


def test_signs_of_zeros_and_of_quaternions_are_ignored() -> None:
    model = everything()
    nominal = moved_numbers(model)
    for array in (model.body_pos, model.jnt_pos, model.geom_margin, model.qpos0, model.wrap_prm):
        array[array == 0.0] = -0.0
    assert repr(moved_numbers(model)) == repr(nominal)
    quaternions = (model.body_quat, model.body_iquat, model.geom_quat, model.site_quat)
    for turned in (False, True):  # By 180° about x.
        for array in quaternions if turned else ():
            array[:] = (0.0, 1.0, 0.0, 0.0)
        nominal = moved_numbers(model)
        for array in quaternions:
            array *= -1.0
        assert moved_numbers(model) == nominal


def test_a_polynomial_spring_changes_only_its_own_element() -> None:
    model = everything()
    before = moved_numbers(model)
    model.tendon_stiffnesspoly[0] = model.jnt_stiffnesspoly[1] = 1.0
    after = moved_numbers(model)
    for section, changed in (("tendons", "string"), ("joints", "shoulder")):
        assert [n for n, row in after[section].items() if row != before[section][n]] == [changed]


def _set(model: mujoco.MjModel, flags: str, bit: int) -> None:
    setattr(model.opt, flags, getattr(model.opt, flags) | bit)


_UNSEEN: dict[str, Callable[[mujoco.MjModel], object]] = {
    "colour": lambda m: m.geom_rgba.fill(0.5),
    "material": lambda m: m.geom_matid.fill(-1),
    "material colour": lambda m: m.mat_rgba.fill(0.1),
    "texture": lambda m: m.tex_data.fill(7),
    "camera": lambda m: m.cam_pos.fill(3.0),
    "light": lambda m: m.light_pos.fill(3.0),
    "visual": lambda m: setattr(m.vis.map, "znear", 0.5),
    "extent": lambda m: setattr(m.stat, "extent", 99.0),
    "size of a plane": lambda m: m.geom("floor").size.fill(9.0),
    "geom group": lambda m: m.geom_group.fill(3),
    "site size": lambda m: m.site_size.fill(1.0),
    "site without a use": lambda m: m.site("decor").pos.fill(1.0),
    "geom without a use": lambda m: m.geom("paint").size.fill(1.0),
    "tendon width": lambda m: m.tendon_width.fill(0.5),
    "softness of friction that is zero": lambda m: m.dof_solimp.__setitem__(-1, 0.7),
    "mass of what cannot move": lambda m: m.body("stand").mass.fill(9.0),
    "inertia of what cannot move": lambda m: m.body("stand").inertia.fill(9.0),
    "gravity compensation of what cannot move": lambda m: m.body_gravcomp.__setitem__(
        m.body("stand").id, 0.5
    ),
    "custom number": lambda m: m.numeric_data.fill(9.0),
    "keyframe": lambda m: m.key_qpos.fill(0.1),
    "sensor noise": lambda m: m.sensor_noise.fill(0.1),
    "control range without a limit": lambda m: m.actuator("servo").ctrlrange.fill(7.0),
    "bias that the type ignores": lambda m: m.actuator("motor").biasprm.fill(7.0),
    "tendon range without a limit": lambda m: m.tendon_range.__setitem__(1, 7.0),
    "geom parameters under a pair": lambda m: m.geom("leg").friction.fill(0.5),
    "tolerance of sleep that is off": lambda m: setattr(m.opt, "sleep_tolerance", 0.5),
    "magnetic field": lambda m: m.opt.magnetic.fill(0.5),
    "override that is off": lambda m: m.opt.o_friction.fill(0.5),
    "energy flag": lambda m: _set(m, "enableflags", mujoco.mjtEnableBit.mjENBL_ENERGY),
    "sensor flag": lambda m: _set(m, "disableflags", mujoco.mjtDisableBit.mjDSBL_SENSOR),
    "contact bits of a geom compiled with none": lambda m: m.geom_contype.__setitem__(10, 1),
}
# Written to a compiled model, these count only after `mj_setConst`.
_CURABLE: dict[str, Callable[[mujoco.MjModel], object]] = {
    "surface velocity": lambda m: m.geom_surfacevel.__setitem__(0, 0.5),
    "adhesion": lambda m: m.geom_adhesion.__setitem__(0, 0.5),
    "adhesion of a pair": lambda m: m.pair_adhesion.__setitem__(0, 0.5),
    "damping of an actuator": lambda m: m.actuator_damping.__setitem__(0, 0.5),
    "armature of an actuator": lambda m: m.actuator_armature.__setitem__(0, 0.5),
}


@pytest.mark.parametrize("what", [*_UNSEEN, *_CURABLE])
def test_values_without_effect_are_left_out(what: str) -> None:
    """Values without effect change neither the compared numbers nor a simulated motion."""
    nominal, written = everything(), everything()
    (_UNSEEN | _CURABLE)[what](written)
    assert moved_numbers(written) == moved_numbers(nominal)
    moved: list[Any] = []
    for model in (nominal, written):
        data, random = mujoco.MjData(model), np.random.default_rng(0)
        data.qvel[:], data.ctrl[:] = random.normal(size=model.nv), random.uniform(size=model.nu)
        mujoco.mj_step(model, data, nstep=60)
        moved.append(data.qpos)
    np.testing.assert_array_equal(*moved)
    if what in _CURABLE:
        mujoco.mj_setConst(written, mujoco.MjData(written))
        assert fingerprint(written) != fingerprint(nominal)


@pytest.mark.parametrize(("density", "viscosity"), [(0.2, 0.0), (0.0, 0.1), (0.0, 0.0)])
def test_wind_and_fluid_shapes_count_only_in_a_medium(density: float, viscosity: float) -> None:
    for edit in (lambda m: m.opt.wind.fill(3.0), lambda m: m.geom_fluid[:, 3].fill(7.0)):
        model = everything()
        model.opt.wind[:], model.geom_fluid[:, 1] = 0.0, 0.0
        model.opt.density, model.opt.viscosity = density, viscosity
        still = moved_numbers(model)
        edit(model)
        assert (moved_numbers(model) != still) == bool(density or viscosity)


def test_what_has_no_part_in_the_motion_is_left_out() -> None:
    """Bodies of cameras only are left out; moving masses, their parents and pinned bodies stay."""
    xml = (
        "<mujoco><asset><hfield name='h' nrow='2' ncol='2' size='1 1 1 1'/>{}</asset><worldbody>"
        "<geom type='hfield' hfield='h'/><body name='b'><freejoint/><geom size='.1'/>{}</body>{}"
        "</worldbody><equality>{}</equality></mujoco>"
    )
    spare = "<hfield name='i' nrow='3' ncol='2' size='1 1 1 1'/>"
    mount = "<body name='mount'><camera/></body>"
    load = "<body name='load'><inertial mass='.5' pos='0 0 0' diaginertia='1 1 1'/></body>"
    shelf = "<body name='shelf'><body name='stone'><geom size='.1'/></body></body>"
    pin = "<connect body1='mount' body2='b' anchor='0 0 0'/>"

    def model(*parts: str) -> mujoco.MjModel:
        return mujoco.MjModel.from_xml_string(xml.format(*parts))

    plain = model("", "", "", "")
    assert moved_numbers(model(spare, mount, mount.replace("mount", "post"), "")) == (
        moved_numbers(plain)
    )
    found = moved_numbers(model("", load, mount + shelf, pin))["bodies"]
    assert list(found) == ["b", "load", "mount", "shelf", "stone"]
    plain.body_mass[1] = plain.geom_contype[:] = plain.geom_conaffinity[:] = 0.0
    assert list(moved_numbers(plain)["bodies"]) == ["b"]  # Its joint moves.


def test_every_geom_that_can_touch_a_flex_counts() -> None:
    geoms = (
        "<geom name='wall' size='.1' conaffinity='0'/><geom name='drawn' size='.1' contype='0' "
        "conaffinity='0'/><body><freejoint/><geom name='ball' size='.1' contype='0' "
        "conaffinity='0'/></body></worldbody><contact><pair geom1='ball' geom2='floor'/></contact>"
    )
    model = mujoco.MjModel.from_xml_string(_CLOTH.replace("</worldbody>", geoms))
    assert list(moved_numbers(model)["geoms"]) == ["ball", "floor", "wall"]


_PID = """<mujoco>
  <extension><plugin plugin="mujoco.pid"><instance name="pid"><config key="kp" value="1"/>
    </instance></plugin></extension>
  <worldbody><body><joint name="j"/><geom size=".1"/></body></worldbody>
  <actuator><plugin joint="j" plugin="mujoco.pid" instance="pid" actdim="0"/></actuator>
</mujoco>"""


@pytest.mark.parametrize(
    ("text", "write"),
    [
        (_CLOTH, lambda m: m.flex_friction.fill(0.1)),
        (_CLOTH, lambda m: m.flex_vert.fill(0.1)),
        (_CLOTH, lambda m: m.geom_pos.fill(0.1)),  # The cloth can touch it.
        (_CLOTH, lambda m: setattr(m.opt, "sleep_tolerance", 0.5)),
        (_PID, lambda m: m.plugin_attr.__setitem__(0, b"2")),
        (_RARE, lambda m: m.jnt_springyield.fill(0.2)),
        (_RARE, lambda m: m.geom_surfacevel.fill(0.2)),
        (_RARE, lambda m: m.actuator_delay.fill(0.02)),
        (_RARE, lambda m: setattr(m.opt, "disableactuator", 1)),
        (EVERYTHING, lambda m: m.geom_fluid[:, 3].fill(7.0)),
        *(
            (EVERYTHING, lambda m, option=option, value=value: setattr(m.opt, option, value))
            for option, value in (
                *(("integrator", 1), ("cone", 1), ("jacobian", 0), ("solver", 1)),
                ("disableflags", mujoco.mjtDisableBit.mjDSBL_GRAVITY),
                ("enableflags", mujoco.mjtEnableBit.mjENBL_SPECULATIVE),
            )
        ),
    ],
)
def test_switches_and_rare_features_count(
    text: str, write: Callable[[mujoco.MjModel], object]
) -> None:
    nominal, written = (mujoco.MjModel.from_xml_string(text) for _ in range(2))
    write(written)
    assert fingerprint(written) != fingerprint(nominal)
    found = {each.element: each.quantity for each in compare(nominal, written)}
    assert {found[name] for name in TABLE["whole"] if name in found} <= {"type", "array"}
    assert found


def test_a_fingerprint_is_the_same_in_every_process() -> None:
    """A fingerprint is 16 hexadecimal digits, and does not depend on Python's hash seed."""
    script = (
        f"import sys; sys.path[:] = {sys.path!r}\n"
        "import mujoco\n"
        "from shapechanger.morphology.certificate import fingerprint\n"
        "print(fingerprint(mujoco.MjModel.from_xml_string(sys.stdin.read())))"
    )
    run = subprocess.run(
        [sys.executable, "-c", script], input=EVERYTHING, check=True, capture_output=True, text=True
    )
    assert run.stdout.strip() == fingerprint(everything())
    assert re.fullmatch("[0-9a-f]{16}", fingerprint(everything()))


_ROUNDED = ("body_", "geom_", "site_", "jnt_", "dof_", "qpos", "actuator_", "tendon_", "mesh_vert")


@pytest.mark.parametrize("name", ["ant", "humanoid", "everything"])
@pytest.mark.parametrize("seed", range(4))
def test_the_last_bits_do_not_count(name: str, seed: int) -> None:
    """Rounding by another processor, also of a computed zero, does not change the fingerprint."""
    model = everything() if name == "everything" else asset(name)
    nominal, random = fingerprint(model), np.random.default_rng(seed)
    for array in (each for each in dir(model) if each.startswith(_ROUNDED)):
        values = getattr(model, array)
        if not isinstance(values, np.ndarray) or not values.size:
            continue
        if values.dtype == np.float32:  # Computed in double precision, so few of them change.
            values.flat[random.integers(values.size)] *= 1.0 + np.finfo(np.float32).eps
        elif values.dtype == np.float64:
            noise = random.uniform(-4e-16, 4e-16, values.shape)
            computed = array in ("body_pos", "body_ipos", "geom_pos", "site_pos", "jnt_axis")
            values[:] = values * (1.0 + noise) + (0.1 * noise if computed else 0.0)
    assert fingerprint(model) == nominal
    model.body_mass[-1] *= 1.0 + 1e-6
    assert fingerprint(model) != nominal


@pytest.mark.parametrize("name", ["ant", "hopper", "humanoid", "inverted_pendulum", "walker2d_v5"])
def test_names_equal_those_of_name_elements(name: str) -> None:
    spec = asset_spec(name)
    name_elements(spec)
    named = spec.compile()
    assert names_of(named) == names_of(asset(name))
    assert fingerprint(named) == fingerprint(asset(name))


def test_elements_without_a_name_are_named_after_their_kind_or_target() -> None:
    names = names_of(_rare())
    assert names["actuators"] == ["slow", "winch", "swivel"]
    assert (names["equalities"], names["bodies"]) == (["equality"], ["world", "hinge", "swivel"])


_PLAIN = """<mujoco>
  <asset><texture name="sky" type="skybox" builtin="flat" width="4" height="4"/></asset>
  <worldbody><body name="leg"><joint name="knee"/>
    <geom name="shin" size="0.1" rgba="1 0 0 1"/><site name="toe" pos="0 0 0.1"/>
    <camera name="eye" pos="0 0 1"/><light pos="0 0 3"/></body></worldbody>
  <sensor><jointpos name="angle" joint="knee" cutoff="1"/><force site="toe"/></sensor>
  <keyframe><key name="home" qpos="0.5"/></keyframe>
  <custom><numeric name="target" data="1e-20 2e-20"/></custom>
</mujoco>"""


@pytest.mark.parametrize(
    ("old", "new", "drawn"),
    [
        ("0 0 0.1", "0 0 0.2", False),
        ('cutoff="1"', 'cutoff="2"', False),
        ('qpos="0.5"', 'qpos="0.6"', False),
        ('data="1e-20 2', 'data="1e-20 3', False),
        ('name="home"', 'name="rest"', False),
        ('jointpos name="angle"', 'jointvel name="angle"', False),
        ('0 0 1"/><light', '0 0 2"/><light', True),
        ("1 0 0 1", "0 1 0 1", True),
        ("0 0 3", "0 0 4", True),
    ],
)
def test_each_change_counts_where_it_can_be_read(old: str, new: str, drawn: bool) -> None:
    """Cameras, colours and lights count only if frames are observed."""
    assert old in _PLAIN
    one, two = (
        mujoco.MjModel.from_xml_string(text) for text in (_PLAIN, _PLAIN.replace(old, new, 1))
    )
    for frames in (False, True):
        prints = [fingerprints(model, drawn=frames) for model in (one, two)]
        assert prints[0][0] == prints[1][0] == fingerprint(one)
        assert (prints[0][1] != prints[1][1]) == (frames or not drawn)
        assert prints[0] == fingerprints(one, drawn=frames)
