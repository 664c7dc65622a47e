"""Fingerprints change with the motion and with nothing else."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from shapechanger.morphology.certificate import fingerprint
from tests.morphology.scenes import EVERYTHING, asset, asset_spec, everything


def test_a_fingerprint_is_sixteen_hex_digits() -> None:
    """The fingerprint is a short hexadecimal number."""
    text = fingerprint(asset("ant"))
    assert len(text) == 16
    assert int(text, 16) >= 0


@pytest.mark.parametrize("name", ["ant", "hopper", "humanoid", "inverted_pendulum"])
def test_compiling_twice_gives_one_fingerprint(name: str) -> None:
    """Equal files have equal fingerprints."""
    assert fingerprint(asset(name)) == fingerprint(asset(name))


def test_another_process_gives_the_same_fingerprint() -> None:
    """The fingerprint does not depend on the hash seed of Python."""
    script = (
        "import sys, mujoco\n"
        "from shapechanger.morphology.certificate import fingerprint\n"
        "print(fingerprint(mujoco.MjModel.from_xml_string(sys.stdin.read())))"
    )
    run = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path[:] = {sys.path!r}\n{script}"],
        input=EVERYTHING,
        check=True,
        capture_output=True,
        text=True,
    )
    assert run.stdout.strip() == fingerprint(everything())


def test_bodies_have_different_fingerprints() -> None:
    """Gymnasium's robots have distinct fingerprints."""
    names = ["ant", "hopper", "humanoid", "inverted_pendulum", "reacher", "swimmer", "walker2d_v5"]
    assert len({fingerprint(asset(name)) for name in names}) == len(names)


# Changes that alter the motion: array of the model, row, factor and offset.
_PHYSICAL: list[tuple[str, int, float, float]] = [
    ("qpos0", -1, 1.0, 0.1),
    ("qpos_spring", 11, 1.0, 0.1),  # The wrist.
    ("body_pos", 4, 1.0, 0.1),
    ("body_quat", 4, 1.0, 0.1),
    ("body_mass", 4, 1.1, 0.0),
    ("body_inertia", 4, 1.1, 0.0),
    ("body_ipos", 4, 1.0, 0.1),
    ("body_iquat", 4, 1.0, 0.1),
    ("body_gravcomp", 4, 1.0, 0.1),
    ("body_invweight0", 4, 1.1, 0.0),
    ("body_subtreemass", 4, 1.1, 0.0),
    ("dof_M0", 3, 1.1, 0.0),
    ("dof_invweight0", 3, 1.1, 0.0),
    ("jnt_pos", 2, 1.0, 0.1),
    ("jnt_axis", 2, 1.0, 0.1),
    ("jnt_range", 2, 1.1, 0.0),
    ("jnt_limited", 2, 0.0, 0.0),
    ("jnt_margin", 2, 1.0, 0.1),
    ("jnt_solref", 2, 1.1, 0.0),
    ("jnt_solimp", 2, 1.01, 0.0),
    ("jnt_stiffness", 2, 1.1, 0.0),
    ("jnt_stiffnesspoly", 2, 1.0, 0.1),
    ("jnt_actfrcrange", 2, 1.1, 0.0),
    ("jnt_actgravcomp", 2, 1.0, 1.0),
    ("dof_damping", 9, 1.1, 0.0),
    ("dof_dampingpoly", 9, 1.0, 0.1),
    ("dof_armature", 9, 1.1, 0.0),
    ("dof_frictionloss", 9, 1.1, 0.0),
    ("dof_solref", 9, 1.1, 0.0),
    ("dof_solimp", 9, 1.01, 0.0),
    ("geom_size", 4, 1.1, 0.0),
    ("geom_rbound", 4, 1.1, 0.0),
    ("geom_pos", 6, 1.0, 0.1),
    ("geom_quat", 6, 1.0, 0.1),
    ("geom_friction", 0, 1.1, 0.0),
    ("geom_solref", 0, 1.1, 0.0),
    ("geom_solimp", 0, 1.01, 0.0),
    ("geom_condim", 0, 2.0, 0.0),
    ("geom_margin", 0, 1.0, 0.1),
    ("geom_gap", 0, 1.0, 0.1),
    ("geom_fluid", 4, 1.1, 0.0),
    ("mesh_vert", 0, 1.0, 0.1),
    ("hfield_data", 0, 1.0, 0.1),
    ("hfield_size", 0, 1.1, 0.0),
    ("site_pos", 0, 1.0, 0.1),
    ("site_quat", 4, 1.0, 0.1),
    ("pair_friction", 0, 1.1, 0.0),
    ("pair_dim", 0, 2.0, 0.0),
    ("pair_solref", 0, 1.1, 0.0),
    ("pair_solimp", 0, 1.01, 0.0),
    ("pair_margin", 0, 1.0, 0.1),
    ("pair_gap", 0, 1.0, 0.1),
    ("exclude_signature", 0, 0.0, 0.0),
    ("geom_contype", 3, 0.0, 0.0),
    ("geom_conaffinity", 8, 0.0, 0.0),
    ("eq_active0", 0, 1.0, 1.0),
    ("eq_data", 2, 1.0, 0.1),
    ("eq_solref", 2, 1.1, 0.0),
    ("eq_solimp", 2, 1.01, 0.0),
    ("eq_obj1id", 2, 1.0, 1.0),
    ("tendon_range", 0, 1.1, 0.0),
    ("tendon_limited", 0, 0.0, 0.0),
    ("tendon_margin", 0, 1.0, 0.1),
    ("tendon_solref_lim", 0, 1.1, 0.0),
    ("tendon_solimp_lim", 0, 1.01, 0.0),
    ("tendon_solref_fri", 0, 1.1, 0.0),
    ("tendon_solimp_fri", 0, 1.01, 0.0),
    ("tendon_stiffness", 0, 1.1, 0.0),
    ("tendon_stiffnesspoly", 0, 1.0, 0.1),
    ("tendon_lengthspring", 0, 1.1, 0.0),
    ("tendon_damping", 0, 1.1, 0.0),
    ("tendon_dampingpoly", 0, 1.0, 0.1),
    ("tendon_armature", 0, 1.0, 0.1),
    ("tendon_frictionloss", 0, 1.1, 0.0),
    ("tendon_actfrclimited", 0, 1.0, 1.0),
    ("tendon_length0", 0, 1.1, 0.0),
    ("tendon_invweight0", 0, 1.1, 0.0),
    ("wrap_prm", -1, 1.1, 0.0),
    ("wrap_objid", 0, 1.0, 1.0),
    ("actuator_gear", 0, 1.1, 0.0),
    ("actuator_gainprm", 0, 1.1, 0.0),
    ("actuator_biasprm", 1, 1.1, 0.0),
    ("actuator_dynprm", 3, 1.1, 0.0),
    ("actuator_ctrlrange", 0, 1.1, 0.0),
    ("actuator_ctrllimited", 0, 0.0, 0.0),
    ("actuator_forcerange", 0, 1.1, 0.0),
    ("actuator_forcelimited", 0, 0.0, 0.0),
    ("actuator_actrange", 3, 1.1, 0.0),
    ("actuator_actearly", 3, 1.0, 1.0),
    ("actuator_lengthrange", 2, 1.1, 0.0),
    ("actuator_cranklength", 7, 1.1, 0.0),
    ("actuator_trnid", 0, 1.0, 1.0),
    ("actuator_ctrlspec", 9, 2.0, 0.0),
    ("actuator_length0", 0, 1.0, 0.1),
    ("actuator_acc0", 0, 1.1, 0.0),
]


@pytest.mark.parametrize(("array", "row", "factor", "offset"), _PHYSICAL, ids=lambda x: str(x))
def test_every_physical_number_is_in_the_fingerprint(
    array: str, row: int, factor: float, offset: float
) -> None:
    """A change of any physical array changes the fingerprint."""
    model = everything()
    nominal = fingerprint(model)
    values = getattr(model, array)
    values[row] = factor * values[row] + offset
    assert fingerprint(model) != nominal


def test_the_mix_counts_where_there_is_something_to_mix() -> None:
    """The weight of a geom's solver parameters is nothing between equal ones."""
    alike, apart = everything(), everything()
    apart.geom_solref[0, 0] *= 2.0
    for model, counts in ((alike, False), (apart, True)):
        nominal = fingerprint(model)
        model.geom_solmix[0] *= 0.5
        assert (fingerprint(model) != nominal) is counts


@pytest.mark.parametrize("name", ["ant", "humanoid", "everything"])
@pytest.mark.parametrize("seed", range(4))
def test_the_last_bits_do_not_count(name: str, seed: int) -> None:
    """Another processor rounds every number in its own way, and a computed zero is not zero."""
    model = everything() if name == "everything" else asset(name)
    nominal, random = fingerprint(model), np.random.default_rng(seed)
    for array in (each for each in dir(model) if each.startswith(_ROUNDED)):
        values = getattr(model, array)
        if not isinstance(values, np.ndarray) or not values.size:
            continue
        if values.dtype == np.float32:  # Computed in double precision, so few are another number.
            values.flat[random.integers(values.size)] *= 1.0 + np.finfo(np.float32).eps
        elif values.dtype == np.float64:
            noise = random.uniform(-4e-16, 4e-16, values.shape)
            computed = array in ("body_pos", "body_ipos", "geom_pos", "site_pos", "jnt_axis")
            values[:] = values * (1.0 + noise) + (0.1 * noise if computed else 0.0)
    assert fingerprint(model) == nominal
    model.body_mass[-1] *= 1.0 + 1e-6
    assert fingerprint(model) != nominal


_ROUNDED = ("body_", "geom_", "site_", "jnt_", "dof_", "qpos", "actuator_", "tendon_", "mesh_vert")

_OPTIONS = {
    "timestep": 0.004,
    "impratio": 2.0,
    "tolerance": 1e-6,
    "ls_tolerance": 0.1,
    "noslip_tolerance": 1e-5,
    "ccd_tolerance": 1e-5,
    "density": 2.0,
    "viscosity": 2.0,
    "gravity": [0.0, 0.0, -5.0],
    "wind": [0.0, 1.0, 0.0],
    "integrator": mujoco.mjtIntegrator.mjINT_RK4,
    "cone": mujoco.mjtCone.mjCONE_ELLIPTIC,
    "jacobian": mujoco.mjtJacobian.mjJAC_DENSE,
    "solver": mujoco.mjtSolver.mjSOL_CG,
    "iterations": 7,
    "ls_iterations": 7,
    "noslip_iterations": 7,
    "ccd_iterations": 7,
    "sdf_iterations": 7,
    "sdf_initpoints": 7,
    "disableactuator": 1,
    "disableflags": mujoco.mjtDisableBit.mjDSBL_GRAVITY,
    "enableflags": mujoco.mjtEnableBit.mjENBL_SPECULATIVE,
}


@pytest.mark.parametrize("option", _OPTIONS)
def test_every_physical_option_is_in_the_fingerprint(option: str) -> None:
    model = everything()
    nominal = fingerprint(model)
    setattr(model.opt, option, _OPTIONS[option])
    assert fingerprint(model) != nominal


def _torso(spec: mujoco.MjSpec) -> mujoco.MjsBody:
    return spec.body("torso")


_EDITS: dict[str, Callable[[mujoco.MjSpec], object]] = {
    "longer leg": lambda s: setattr(s.geom("left_ankle_geom"), "fromto", [0, 0, 0, 0.5, 0.5, 0]),
    "thicker torso": lambda s: setattr(s.geom("torso_geom"), "size", [0.3, 0, 0]),
    "denser torso": lambda s: setattr(s.geom("torso_geom"), "density", 9.0),
    "narrower joint": lambda s: setattr(s.joint("hip_1"), "range", [-10, 10]),
    "moved leg": lambda s: setattr(s.body("aux_1"), "pos", [0.3, 0.2, 0]),
    "another joint": lambda s: s.body("aux_1").add_joint(
        name="more", axis=[1, 0, 0], range=[-1, 1]
    ),
    "another motor": lambda s: s.add_actuator(
        name="more", target="hip_1", trntype=mujoco.mjtTrn.mjTRN_JOINT
    ),
    "rougher foot": lambda s: setattr(s.geom("left_ankle_geom"), "friction", [1.5, 0.5, 0.5]),
    "feet that collide": lambda s: setattr(s.geom("left_ankle_geom"), "conaffinity", 1),
    "lighter world": lambda s: setattr(s.option, "gravity", [0, 0, -5]),
}
_LOOKS: dict[str, Callable[[mujoco.MjSpec], object]] = {
    "colour": lambda s: setattr(s.geom("torso_geom"), "rgba", [1, 0, 0, 1]),
    "camera": lambda s: s.worldbody.add_camera(name="eye", pos=[0, 0, 3]),
    "camera on the torso": lambda s: _torso(s).add_camera(name="eye", pos=[0, 0, 3]),
    "light": lambda s: s.worldbody.add_light(name="sun", pos=[0, 0, 3]),
    "site": lambda s: _torso(s).add_site(name="sticker"),
    "drawn geom": lambda s: s.worldbody.add_geom(
        name="picture", size=[1, 0, 0], contype=0, conaffinity=0
    ),
    "sensor": lambda s: s.add_sensor(
        name="angle",
        type=mujoco.mjtSensor.mjSENS_JOINTPOS,
        objtype=mujoco.mjtObj.mjOBJ_JOINT,
        objname="hip_1",
    ),
    "keyframe": lambda s: s.add_key(name="start"),
    "custom number": lambda s: s.add_numeric(name="seven", data=[7.0]),
    "friction below the floor's": lambda s: setattr(
        s.geom("left_ankle_geom"), "friction", [0.2, 0.5, 0.5]
    ),
    "torsional friction that nothing uses": lambda s: setattr(
        s.geom("left_ankle_geom"), "friction", [1.0, 0.9, 0.5]
    ),
    "harder contact than the time step allows": lambda s: setattr(
        s.geom("floor"), "solref", [0.001, 1.0]
    ),
}


@pytest.mark.parametrize("edit", _EDITS)
def test_edits_of_the_ant_change_its_fingerprint(edit: str) -> None:
    """Edits of shape, mass, joints, motors and world change the fingerprint."""
    spec = asset_spec("ant")
    _EDITS[edit](spec)
    assert fingerprint(spec.compile()) != fingerprint(asset("ant"))


@pytest.mark.parametrize("look", _LOOKS)
def test_looks_do_not_change_the_fingerprint(look: str) -> None:
    """Visuals, sensors and masked parameters do not change the fingerprint."""
    spec = asset_spec("ant")
    _LOOKS[look](spec)
    assert fingerprint(spec.compile()) == fingerprint(asset("ant"))


# Writes to a compiled model without effect: array, row, offset, and whether `mj_setConst` makes
# them count.
_IGNORED: list[tuple[str, int, float, bool]] = [
    ("geom_surfacevel", 0, 0.5, True),
    ("geom_adhesion", 0, 0.5, True),
    ("pair_adhesion", 0, 0.5, True),
    ("actuator_damping", 0, 0.5, True),
    ("actuator_armature", 0, 0.5, True),
    ("geom_contype", 10, 1.0, False),  # The wheel was compiled without colliding geoms.
    ("jnt_springyield", 2, 0.1, False),
    ("tendon_springyield", 0, 0.1, False),
    ("actuator_delay", 0, 0.1, False),
]


@pytest.mark.parametrize(("array", "row", "offset", "curable"), _IGNORED, ids=lambda x: str(x))
def test_ignored_writes_do_not_change_the_fingerprint(
    array: str, row: int, offset: float, curable: bool
) -> None:
    """Numbers that the simulation does not read do not change the fingerprint.

    Some of them count after `mj_setConst`.
    """
    nominal, written = everything(), everything()
    getattr(written, array)[row] += offset
    assert fingerprint(written) == fingerprint(nominal)
    np.testing.assert_array_equal(_motion(written), _motion(nominal))
    if curable:
        mujoco.mj_setConst(written, mujoco.MjData(written))
        assert fingerprint(written) != fingerprint(nominal)


def _motion(model: mujoco.MjModel) -> NDArray[np.float64]:
    """Return the positions after some steps from a random start, shape (nq,)."""
    data = mujoco.MjData(model)
    random = np.random.default_rng(0)
    data.qvel[:] = random.normal(size=model.nv)
    data.ctrl[:] = random.uniform(size=model.nu)
    mujoco.mj_step(model, data, nstep=60)
    return data.qpos.copy()
