"""Small models and helpers shared by tests of edits."""

from __future__ import annotations

import os
from collections.abc import Iterable

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.envs.ant import ANT
from shapechanger.envs.pendulum import PENDULUM
from shapechanger.morphology import Edit, compile_body
from tests.models import xml
from tests.morphology.scenes import ASSETS

Array = NDArray[np.float64]

# A leg of two segments on a free trunk above a floor, in degrees like most models.
LEG = xml("leg")

# A body with several joints away from its origin, in radians.
GANTRY = xml("gantry")

# An arm of two joints on a base, as URDF. The second joint has no effort limit.
URDF = xml("urdf")

# An arm of two segments, with places for more elements.
ARM = xml("arm")
ROPE = '<site site="shoulder"/><site site="hand"/>'


def spec_of(text: str) -> mujoco.MjSpec:
    return mujoco.MjSpec.from_string(text)


def leg() -> mujoco.MjSpec:
    return spec_of(LEG)


def gantry() -> mujoco.MjSpec:
    return spec_of(GANTRY)


def uncoupled_gantry() -> mujoco.MjSpec:
    spec = gantry()
    for equality in list(spec.equalities):
        spec.delete(equality)
    return spec


def ant() -> mujoco.MjSpec:
    return ANT.load(os.path.join(ASSETS, "ant.xml"))


def pendulum() -> mujoco.MjSpec:
    return PENDULUM.load(os.path.join(ASSETS, "inverted_pendulum.xml"))


def limb(content: str, compiler: str = "") -> mujoco.MjSpec:
    return spec_of(
        f"""<mujoco><compiler {compiler}/><worldbody><body name="trunk"><geom name="trunk"
        type="box" size=".1 .1 .1"/><body name="link" pos="0 0 1"><joint name="link" axis="0 1 0"/>
        {content}</body></body></worldbody></mujoco>"""
    )


def arm(rest: str = "", **more: str) -> mujoco.MjSpec:
    parts = dict.fromkeys(("top", "root", "trunk", "joint", "upper", "lower"), "")
    return spec_of(ARM.format(rest=rest, **{**parts, **more}))


def spatial(path: str, more: str = "") -> str:
    return f'<tendon><spatial name="rope" {more}>{path}</spatial></tendon>'


def built(spec: mujoco.MjSpec, *edits: Edit) -> mujoco.MjModel:
    return compile_body(spec, edits)


def differing(a: mujoco.MjModel, b: mujoco.MjModel, ignoring: Iterable[str] = ()) -> list[str]:
    """Return the arrays in which two models differ bitwise, except for names and paths."""
    fields = [name for name in dir(a) if isinstance(getattr(a, name), np.ndarray)]
    skipped = ("_", "name_", "names_", "paths")
    unlike = [
        name
        for name in fields
        if not name.startswith(skipped)
        and not np.array_equal(getattr(a, name), getattr(b, name), equal_nan=True)
    ]
    return sorted({*unlike} - {*ignoring})


def mass(model: mujoco.MjModel, *bodies: str) -> float:
    if not bodies:
        return float(model.body_mass.sum())
    return float(sum(model.body(name).mass[0] for name in bodies))


def posed(model: mujoco.MjModel, angles: dict[str, float] | None = None) -> mujoco.MjData:
    """Return the kinematics with some hinges and slides at given positions, rad or m."""
    data = mujoco.MjData(model)
    for joint, position in (angles or {}).items():
        data.joint(joint).qpos[:] = position
    mujoco.mj_kinematics(model, data)
    return data


def check_at_rest(model: mujoco.MjModel) -> None:
    """Check that all equalities hold in the model's own pose."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    rows = data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
    np.testing.assert_allclose(data.efc_pos[rows], 0.0, atol=1e-8)


def tip(model: mujoco.MjModel, site: str, angles: dict[str, float] | None = None) -> Array:
    return np.array(posed(model, angles).site(site).xpos)


def capsule_mass(radius: float, length: float, density: float) -> float:
    """Return the mass of a capsule with an axis of this length, kg."""
    return density * np.pi * radius**2 * (length + 4.0 / 3.0 * radius)


def capsule_inertia(radius: float, length: float, density: float) -> tuple[float, float]:
    """Return the moments of inertia of a capsule, across its axis and along it, kg·m²."""
    cylinder = density * np.pi * radius**2 * length
    caps = density * np.pi * radius**3 * 4.0 / 3.0
    along = 0.5 * cylinder * radius**2 + 0.4 * caps * radius**2
    # The centre of mass of a half ball is 3/8 of its radius from the flat side.
    across = cylinder * (radius**2 / 4.0 + length**2 / 12.0) + caps * (
        0.4 * radius**2 + length**2 / 4.0 + 3.0 / 8.0 * length * radius
    )
    return across, along


def physics(model: mujoco.MjModel, angles: dict[str, float] | None = None) -> dict[str, Array]:
    """Return the physical properties of a model, keyed by name, with joints at given positions.

    Mass, centre of mass and inertia add up all bodies, so that models with
    different bodies can be compared.
    """
    data = posed(model, {j: p for j, p in (angles or {}).items() if _has_joint(model, j)})
    weights = model.body_mass[1:] / model.body_mass.sum()
    centre = weights @ data.xipos[1:]
    inertia = np.zeros((3, 3))
    for body in range(1, model.nbody):
        turn, arm = data.ximat[body].reshape(3, 3), data.xipos[body] - centre
        inertia += turn @ np.diag(model.body_inertia[body]) @ turn.T
        inertia += model.body_mass[body] * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    found = {
        "mass": model.body_mass.sum(keepdims=True),
        "centre of mass": centre,
        "inertia": inertia,
        "gravity": np.array(model.opt.gravity),
        "start": np.array(model.qpos0[:3]),
    }
    for i in range(model.nsite):
        found[f"site {model.site(i).name}"] = np.array(data.site_xpos[i])
    for i in range(model.ngeom):
        name = model.geom(i).name
        found[f"friction {name}"] = np.array(model.geom_friction[i])
        found[f"place {name}"] = np.array(data.geom_xpos[i])
        found[f"size {name}"] = np.array(model.geom_size[i])
    for i in range(model.nu):
        # Divide gears by 100, so that all values are of order one.
        found[f"gear {model.actuator(i).name}"] = 0.01 * model.actuator_gear[i]
    for i in range(model.njnt):
        joint = model.joint(i)
        for field in ("range", "damping", "armature", "stiffness"):
            found[f"{field} {joint.name}"] = np.array(getattr(joint, field))
    return found


def _has_joint(model: mujoco.MjModel, name: str) -> bool:
    return mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name) >= 0
