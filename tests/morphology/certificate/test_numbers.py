"""The numbers that decide the motion of a model."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pytest

from shapechanger.morphology.certificate.numbers import moved_numbers
from tests.morphology.scenes import asset, everything


def test_values_are_found_by_name() -> None:
    """Values have the keys section, element and field."""
    effective = moved_numbers(everything())
    assert effective["bodies"]["hand"]["parent"] == ("arm",)
    assert effective["joints"]["wrist"]["joint range"] == (-1.0, 1.0)
    assert effective["joints"]["wrist"]["spring reference"] == (0.2,)
    assert effective["joints"]["root"]["rest position"] == (0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0)
    assert effective["geoms"]["arm"]["size"] == (0.03, 0.15, 0.0)
    assert effective["actuators"]["motor"]["gear"][:2] == (5.0, 0.0)
    assert effective["actuators"]["ball"]["gear"][:3] == (1.0, 2.0, 3.0)
    assert effective["actuators"]["jet"]["second site"] == ("shoulder",)
    assert effective["actuators"]["pose"]["target"] == ("shoulder",)
    assert effective["tendons"]["couple"]["path elements"] == ("knee", "axle")
    assert effective["tendons"]["string"]["path side sites"][1] == "bypass"
    assert effective["equalities"]["mirror"]["and"] == ("wrist",)
    assert effective["equalities"]["glue"]["between"] == ("glued",)
    assert effective["contacts"]["floor + leg"]["contact friction"][:3] == (0.7, 0.6, 0.0)
    assert effective["sizes"]["nv"]["dimensions"] == (13.0,)


def test_minus_zero_is_zero() -> None:
    """Signs of zeros are ignored."""
    model = everything()
    nominal = moved_numbers(model)
    for array in (model.body_pos, model.jnt_pos, model.geom_margin, model.qpos0, model.wrap_prm):
        array[array == 0.0] = -0.0
    assert repr(moved_numbers(model)) == repr(nominal)


def test_a_quaternion_and_its_opposite_are_one_rotation() -> None:
    """Signs of quaternions are ignored."""
    model = everything()
    nominal = moved_numbers(model)
    for array in (model.body_quat, model.body_iquat, model.geom_quat, model.site_quat):
        array *= -1.0
    assert moved_numbers(model) == nominal


_UNSEEN: dict[str, Any] = {
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
    "range of a joint without limits": lambda m: m.joint("axle").range.fill(0.7),
    "softness of a joint without limits": lambda m: m.joint("axle").solimp.fill(0.7),
    "spring reference without a spring": lambda m: m.qpos_spring.__setitem__(-1, 0.7),
    "softness of friction that is zero": lambda m: m.dof_solimp.__setitem__(-1, 0.7),
    "mass of what cannot move": lambda m: m.body("stand").mass.fill(9.0),
    "inertia of what cannot move": lambda m: m.body("stand").inertia.fill(9.0),
    "control range without a limit": lambda m: m.actuator("servo").ctrlrange.fill(7.0),
    "bias that the type ignores": lambda m: m.actuator("motor").biasprm.fill(7.0),
    "tendon range without a limit": lambda m: m.tendon_range.__setitem__(1, 7.0),
    "geom parameters under a pair": lambda m: m.geom("leg").friction.fill(0.5),
    "magnetic field": lambda m: m.opt.magnetic.fill(0.5),
    "override that is off": lambda m: m.opt.o_friction.fill(0.5),
    "energy flag": lambda m: _set(m, "enableflags", mujoco.mjtEnableBit.mjENBL_ENERGY),
    "sensor flag": lambda m: _set(m, "disableflags", mujoco.mjtDisableBit.mjDSBL_SENSOR),
    "sleep tolerance without sleep": lambda m: setattr(m.opt, "sleep_tolerance", 0.5),
}


def _set(model: mujoco.MjModel, flags: str, bit: int) -> None:
    """Set one bit of the model's flags."""
    setattr(model.opt, flags, getattr(model.opt, flags) | bit)


@pytest.mark.parametrize("what", _UNSEEN)
def test_values_without_effect_are_left_out(what: str) -> None:
    """Changes without effect on the motion leave the effective model unchanged."""
    model = everything()
    nominal = moved_numbers(model)
    _UNSEEN[what](model)
    assert moved_numbers(model) == nominal


@pytest.mark.parametrize("what", ["size of a plane", "mass of what cannot move"])
def test_left_out_values_have_no_effect(what: str) -> None:
    """The two least obvious cases are verified by simulation."""
    positions = []
    for edit in (lambda m: None, _UNSEEN[what]):
        model = everything()
        edit(model)
        mujoco.mj_setConst(model, mujoco.MjData(model))
        data = mujoco.MjData(model)
        data.ctrl[0] = 0.5
        mujoco.mj_step(model, data, nstep=100)
        positions.append(data.qpos.copy())
    np.testing.assert_array_equal(*positions)


def test_wind_counts_only_in_a_medium() -> None:
    """Without density and viscosity, wind and fluid shapes are ignored."""
    model = everything()
    model.opt.density = model.opt.viscosity = 0.0
    still = moved_numbers(model)
    model.opt.wind[:] = 3.0
    model.geom_fluid[:, 3] = 7.0
    assert moved_numbers(model) == still


@pytest.mark.parametrize(("density", "viscosity"), [(1.2, 0.0), (0.0, 0.1)])
def test_density_or_viscosity_makes_a_medium(density: float, viscosity: float) -> None:
    """In each alone, wind blows, and shapes are pushed by the ellipsoid model."""
    for edit in (lambda m: m.opt.wind.fill(3.0), lambda m: m.geom_fluid[:, 3].fill(7.0)):
        model = everything()
        model.opt.wind[:] = 0.0
        model.opt.density, model.opt.viscosity = density, viscosity
        still = moved_numbers(model)
        edit(model)
        assert moved_numbers(model) != still


def test_empty_bodies_are_left_out() -> None:
    """Bodies that hold only a camera are left out; parents of shapes stay."""
    xml = (
        "<mujoco><worldbody><geom type='plane' size='1 1 1'/>{}<body name='b'><freejoint/>"
        "<geom size='.1'/>{}</body></worldbody></mujoco>"
    )
    mount = "<body name='mount'><camera/></body>"
    plain = moved_numbers(mujoco.MjModel.from_xml_string(xml.format("", "")))
    assert moved_numbers(mujoco.MjModel.from_xml_string(xml.format(mount, mount * 0))) == plain
    assert moved_numbers(mujoco.MjModel.from_xml_string(xml.format("", mount))) == plain
    shelf = "<body name='shelf'><body name='stone'><geom size='.1'/></body></body>"
    shelved = moved_numbers(mujoco.MjModel.from_xml_string(xml.format(shelf, "")))
    assert list(shelved["bodies"]) == ["b", "shelf", "stone"]


def test_sleep_counts_only_if_enabled() -> None:
    """Sleep policies are ignored unless sleep is enabled."""
    model = everything()
    awake = moved_numbers(model)
    assert "sleep policy" not in awake["bodies"]["trunk"]
    _set(model, "enableflags", mujoco.mjtEnableBit.mjENBL_SLEEP)
    asleep = moved_numbers(model)
    assert "sleep policy" in asleep["bodies"]["trunk"]
    assert asleep["options"]["simulation"]["switched on"] == ("sleep",)


def test_disabled_actuators_are_marked() -> None:
    model = everything()
    model.actuator("motor").group[:] = 3
    model.opt.disableactuator = 1 << 3
    actuators = moved_numbers(model)["actuators"]
    assert [name for name in actuators if "switched off" in actuators[name]] == ["motor"]


_CLOTH = """
<mujoco>
  <option><flag override="enable"/></option>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 1" pos="0 0 -.1"/>
    <flexcomp name="cloth" type="grid" count="3 3 1" spacing=".1 .1 .1" pos="0 0 1" dim="2"
              radius=".01" mass="1"><edge equality="true"/></flexcomp>
  </worldbody>
</mujoco>
"""


@pytest.mark.parametrize(
    "edit",
    [
        lambda m: m.flex_friction.fill(0.3),
        lambda m: m.flex_radius.fill(0.02),
        lambda m: m.flex_vert.fill(0.1),
        lambda m: m.opt.o_friction.fill(0.3),
        lambda m: m.geom_pos.fill(0.1),
    ],
)
def test_flexes_are_included(edit: Any) -> None:
    """Flexes have their own parameters, and the geoms they can touch are included."""
    model = mujoco.MjModel.from_xml_string(_CLOTH)
    nominal = moved_numbers(model)
    assert nominal["flexes"]["cloth"]["radius"] == (0.01,)
    assert any(fields["between"] == ("cloth",) for fields in nominal["equalities"].values())
    assert "floor" in nominal["geoms"]
    edit(model)
    assert moved_numbers(model) != nominal


def test_plugins_are_included() -> None:
    """The configuration of an engine plugin is part of the model."""
    xml = (
        "<mujoco><extension><plugin plugin='mujoco.pid'><instance name='pid'>"
        "<config key='kp' value='{}'/></instance></plugin></extension>"
        "<worldbody><body><joint name='j'/><geom size='.1'/></body></worldbody>"
        "<actuator><plugin joint='j' plugin='mujoco.pid' instance='pid' actdim='0'/></actuator>"
        "</mujoco>"
    )
    models = [mujoco.MjModel.from_xml_string(xml.format(kp)) for kp in ("1", "2")]
    assert moved_numbers(models[0]) != moved_numbers(models[1])


@pytest.mark.parametrize("name", ["ant", "humanoid", "hopper", "reacher", "swimmer", "pusher"])
def test_gymnasium_bodies_are_supported(name: str) -> None:
    """All joints and actuators of Gymnasium's bodies are included."""
    model = asset(name)
    effective = moved_numbers(model)
    assert len(effective["joints"]) == model.njnt
    assert len(effective["actuators"]) == model.nu
