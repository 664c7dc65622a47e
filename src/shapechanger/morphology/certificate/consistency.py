"""Consistency of the numbers of a compiled model.

A compiled model can be written to. Writing mass without inertia, or either without calling
`mujoco.mj_setConst`, leaves an inconsistent model: MuJoCo softens contacts and limits by inverse
weights that no longer hold, copies frames that no longer coincide, and ignores gravity
compensation, adhesion or an actuator's damping if there was none when the model was compiled.
"""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING, Final

import mujoco
import numpy as np

from shapechanger.morphology.certificate.numbers import names_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

# `mj_setConst` gives the same bits on an untouched model; the margin is for models that were
# compiled elsewhere and loaded from a file.
_TOLERANCE: Final = 1e-6

# What `mj_setConst` computes, by the elements it belongs to, and what goes wrong if it is stale.
_CONSTANTS: Final = {
    "body": {
        "body_subtreemass": "centres of mass are wrong",
        "body_invweight0": "constraints have the wrong softness",
        "body_sameframe": "body_ipos or body_iquat is ignored",
        "body_margin": "contacts may be missed",
    },
    "dof": {
        "dof_M0": "lengths and gains derived from it are wrong",
        "dof_invweight0": "constraints have the wrong softness",
    },
    "geom": {
        "geom_rbound": "contacts may be missed",
        "geom_sameframe": "geom_pos or geom_quat is ignored",
        "geom_fluid": "forces of the fluid are those of the old shape",
    },
    "site": {"site_sameframe": "site_pos or site_quat is ignored"},
    "joint": {"jnt_actuatorid": "the actuator's damping or armature is ignored"},
    "tendon": {
        "tendon_length0": "lengths derived from it are wrong",
        "tendon_invweight0": "constraints have the wrong softness",
        "tendon_actuatorid": "the actuator's damping or armature is ignored",
    },
}
_FLAGS: Final = {
    "flg_gravcomp": "body_gravcomp is ignored",
    "flg_surfacevel": "geom_surfacevel is ignored",
    "flg_adhesion": "geom_adhesion and pair_adhesion are ignored",
}


def inconsistencies(model: mujoco.MjModel) -> tuple[str, ...]:
    """Return the inconsistencies of a model, one sentence each.

    Checked are the inertia of every body that can move, and the constants that
    `mujoco.mj_setConst` computes, against a recomputed copy.
    """
    names = names_of(model)
    return (
        *_impossible_inertias(model, names),
        *_late_bits(model, names),
        *_stale_constants(model, names),
    )


def lone_masses(source: mujoco.MjModel, target: mujoco.MjModel) -> tuple[str, ...]:
    """Find bodies whose mass differs between two models while their inertia does not.

    Args:
        source: Model before.
        target: Model after, with the same bodies.
    """
    before = dict(zip(names_of(source)["bodies"], range(source.nbody), strict=True))
    found: list[str] = []
    for body, i in zip(names_of(target)["bodies"], range(target.nbody), strict=True):
        j = before.get(body)
        if j is None or target.body_treeid[i] < 0:
            continue
        old, new = float(source.body_mass[j]), float(target.body_mass[i])
        same_inertia = np.array_equal(source.body_inertia[j], target.body_inertia[i])
        if old != new and same_inertia and target.body_inertia[i].any():
            found.append(
                f"{body}: mass goes from {old:.4g} to {new:.4g} kg, but its inertia stays "
                f"{target.body_inertia[i].max():.3g} kg·m²: scale both."
            )
    return tuple(found)


def _impossible_inertias(model: mujoco.MjModel, names: dict[str, list[str]]) -> list[str]:
    """Find moving bodies with mass whose principal moments no solid body has."""
    found: list[str] = []
    for i in np.flatnonzero((model.body_treeid >= 0) & (model.body_mass > 0.0)).tolist():
        small, middle, large = sorted(model.body_inertia[i].tolist())
        what = f"{names['bodies'][i]}: mass {model.body_mass[i]:.4g} kg"
        if small < 0.0 or (large == 0.0 and model.body_dofnum[i] > 0):
            found.append(f"{what} comes with inertia {small:.3g} kg·m².")
        elif small + middle < large * (1.0 - _TOLERANCE):
            found.append(
                f"{what} comes with principal moments {small:.3g}, {middle:.3g}, {large:.3g} "
                "kg·m², of which the largest is more than the other two together."
            )
    return found


def _late_bits(model: mujoco.MjModel, names: dict[str, list[str]]) -> list[str]:
    """Find geoms whose contact bits were set after their body's were compiled."""
    owner = model.geom_bodyid
    late = (model.geom_contype & ~model.body_contype[owner]) | (
        model.geom_conaffinity & ~model.body_conaffinity[owner]
    )
    return [
        f"{names['geoms'][i]}: geom_contype or geom_conaffinity has bits that its body was "
        "compiled without, so they are ignored. Compile the model again."
        for i in np.flatnonzero(late).tolist()
    ]


def _stale_constants(model: mujoco.MjModel, names: dict[str, list[str]]) -> list[str]:
    """Find arrays that `mj_setConst` would change, each with the element that changes most."""
    fresh = copy.deepcopy(model)
    try:
        mujoco.mj_setConst(fresh, mujoco.MjData(fresh))
    except mujoco.FatalError as error:
        return [f"MuJoCo cannot derive its constants from the model: {error}."]
    owners: dict[str, list[str]] = {
        "body": names["bodies"],
        "dof": [names["joints"][joint] for joint in model.dof_jntid.tolist()],
        "geom": names["geoms"],
        "site": names["sites"],
        "joint": names["joints"],
        "tendon": names["tendons"],
    }
    remedy = "Call mujoco.mj_setConst after writing to a compiled model."
    found: list[str] = []
    for kind, constants in _CONSTANTS.items():
        for array, consequence in constants.items():
            gap = _largest_gap(getattr(model, array), getattr(fresh, array))
            if gap is not None:
                row, old, new = gap
                found.append(
                    f"{owners[kind][row]}: {array} is {old:.4g}, but the model makes it {new:.4g}, "
                    f"so {consequence}. {remedy}"
                )
    for flag, consequence in _FLAGS.items():
        if getattr(fresh, flag) and not getattr(model, flag):
            found.append(f"{flag} is not set, so {consequence}. {remedy}")
    return found


def _largest_gap(
    old: NDArray[np.number], new: NDArray[np.number]
) -> tuple[int, float, float] | None:
    """Return row and values of the largest relative gap; None if there is none."""
    if not old.size:
        return None
    one, two = (array.reshape(len(array), -1).astype(np.float64) for array in (old, new))
    scale = np.maximum(np.abs(one), np.abs(two))
    gap = np.abs(one - two) / np.where(scale > 0.0, scale, 1.0)
    row, column = np.unravel_index(int(np.argmax(gap)), gap.shape)
    if gap[row, column] <= _TOLERANCE:
        return None
    return int(row), float(one[row, column]), float(two[row, column])
