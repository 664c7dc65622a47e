"""Close the loops of a model: equalities that hold again after its joints have moved."""

from __future__ import annotations

from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.morphology.spec.geometry import Array

CLOSED: Final = 1e-9
"""Residual of an equality that is closed, m or rad; above the rounding of a compiled model."""
SINGULAR: Final = 1e-6
"""Singular values below this share of the largest belong to motions that do not close a loop."""

_E: Final = mujoco.mjtEq
# Equalities that a pose can close, by Gauss-Newton steps on MuJoCo's own Jacobian.
_SOLVED: Final = [
    int(kind) for kind in (_E.mjEQ_CONNECT, _E.mjEQ_WELD, _E.mjEQ_JOINT, _E.mjEQ_TENDON)
]
# A longer step, rad or m, can jump to another way to assemble the loop.
_LONGEST_STEP: Final = 0.2
_UNLIMITED: Final = np.array([[-np.inf], [np.inf]])


def equality_rows(
    model: mujoco.MjModel, data: mujoco.MjData
) -> tuple[NDArray[np.int32], Array, Array]:
    """Return the equality, the violation and the Jacobian (n, nv) of each row of equalities.

    The data have gone through `mj_fwdPosition`.
    """
    ids = data.efc_id[: int(data.ne)]
    rows = np.flatnonzero(np.isin(model.eq_type[ids], _SOLVED))
    dense = np.zeros((int(data.nefc), model.nv))
    if mujoco.mj_isSparse(model):
        mujoco.mju_sparse2dense(
            dense, data.efc_J, data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind
        )
    else:
        dense[:] = data.efc_J.reshape(dense.shape)
    return ids[rows], data.efc_pos[rows], dense[rows]


def close(
    model: mujoco.MjModel, data: mujoco.MjData, movable: NDArray[np.bool_], most_steps: int
) -> float:
    """Move the pose in `data` to the nearest in which the equalities hold.

    Only the `movable` degrees of freedom (nv,) move; hinges and slides stay inside their limits, or
    get no farther outside. The largest violation that is left is returned, m or rad.
    """
    scalar, at_limit = (
        np.flatnonzero(model.jnt_type > int(mujoco.mjtJoint.mjJNT_BALL)),
        np.zeros(model.nv, bool),
    )
    places, dofs = model.jnt_qposadr[scalar], model.jnt_dofadr[scalar]
    low, high = np.where(model.jnt_limited[scalar], model.jnt_range[scalar].T, _UNLIMITED)
    low, high = np.minimum(low, data.qpos[places]), np.maximum(high, data.qpos[places])
    for _ in range(most_steps):
        _, gaps, jacobian = equality_rows(model, data)
        if largest(gaps) <= CLOSED:
            break
        step, moving = np.zeros(model.nv), movable & ~at_limit
        step[moving] = -np.linalg.pinv(jacobian[:, moving], SINGULAR) @ gaps
        step *= min(1.0, _LONGEST_STEP / max(largest(step), _LONGEST_STEP))
        mujoco.mj_integratePos(model, data.qpos, step, 1.0)
        clipped = np.clip(data.qpos[places], low, high)
        # A joint at its limit is left out of the next step, which the others must make.
        at_limit[dofs] = clipped != data.qpos[places]
        data.qpos[places] = clipped
        mujoco.mj_fwdPosition(model, data)
    return largest(equality_rows(model, data)[1])


def largest(numbers: Array) -> float:
    """Return the largest absolute value, 0 of none."""
    return float(np.abs(numbers).max(initial=0.0))
