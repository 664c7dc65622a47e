"""Whether the numbers of a compiled model fit together.

A compiled model can be written to. Mass without inertia, or either without `mujoco.mj_setConst`,
leaves a robot that is neither the old one nor the new one: MuJoCo then softens contacts and limits
by inverse weights that no longer hold.
"""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING, Final

import mujoco
import numpy as np

from shapechanger.morphology.naming import Names, names_of
from shapechanger.morphology.reading import named

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["inconsistencies", "lone_masses"]

# `mj_setConst` gives the same bits on an untouched model; the margin is for models that were
# compiled elsewhere and loaded from a file.
_TOLERANCE: Final = 1e-6

_OF_BODIES: Final = ("body_subtreemass", "body_invweight0")
_OF_DOFS: Final = ("dof_M0", "dof_invweight0")
_OF_TENDONS: Final = ("tendon_length0", "tendon_invweight0")


def inconsistencies(model: mujoco.MjModel) -> tuple[str, ...]:
    """What does not fit together in a model, one sentence each; empty if all does.

    Checked are the inertia of every body that can move, and the constants that
    `mujoco.mj_setConst` computes, against a recomputed copy.
    """
    names = names_of(model)
    return (*_impossible_inertias(model, names), *_stale_constants(model, names))


def lone_masses(source: mujoco.MjModel, target: mujoco.MjModel) -> tuple[str, ...]:
    """Bodies whose mass differs between two models while their inertia does not."""
    before = dict(zip(names_of(source).bodies, range(source.nbody), strict=True))
    found: list[str] = []
    for body, i in zip(names_of(target).bodies, range(target.nbody), strict=True):
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


def _impossible_inertias(model: mujoco.MjModel, names: Names) -> list[str]:
    """Moving bodies with mass whose principal moments no solid body has."""
    found: list[str] = []
    for i in np.flatnonzero((model.body_treeid >= 0) & (model.body_mass > 0.0)).tolist():
        small, middle, large = sorted(model.body_inertia[i].tolist())
        what = f"{names.bodies[i]}: mass {model.body_mass[i]:.4g} kg"
        if small < 0.0 or (large == 0.0 and model.body_dofnum[i] > 0):
            found.append(f"{what} comes with inertia {small:.3g} kg·m².")
        elif small + middle < large * (1.0 - _TOLERANCE):
            found.append(
                f"{what} comes with principal moments {small:.3g}, {middle:.3g}, {large:.3g} "
                "kg·m², of which the largest is more than the other two together."
            )
    return found


def _stale_constants(model: mujoco.MjModel, names: Names) -> list[str]:
    """Arrays that `mj_setConst` would change, each with the element where it changes most."""
    fresh = copy.deepcopy(model)
    mujoco.mj_setConst(fresh, mujoco.MjData(fresh))
    dofs = named(names.joints, model.dof_jntid)
    found: list[str] = []
    for owners, arrays in (
        (names.bodies, _OF_BODIES),
        (dofs, _OF_DOFS),
        (names.tendons, _OF_TENDONS),
    ):
        for array in arrays:
            told = _largest_gap(getattr(model, array), getattr(fresh, array))
            if told is not None:
                row, old, new = told
                found.append(
                    f"{owners[row]}: {array} is {old:.4g}, but the model makes it {new:.4g}: "
                    "call mujoco.mj_setConst after writing to a compiled model."
                )
    return found


def _largest_gap(
    old: NDArray[np.float64], new: NDArray[np.float64]
) -> tuple[int, float, float] | None:
    """Row and values of the largest relative gap; None if there is none."""
    if not old.size:
        return None
    old, new = old.reshape(len(old), -1), new.reshape(len(new), -1)
    scale = np.maximum(np.abs(old), np.abs(new))
    gap = np.abs(old - new) / np.where(scale > 0.0, scale, 1.0)
    row, column = np.unravel_index(int(np.argmax(gap)), gap.shape)
    if gap[row, column] <= _TOLERANCE:
        return None
    return int(row), float(old[row, column]), float(new[row, column])
