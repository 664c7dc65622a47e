"""Poses and velocities that satisfy equalities: coupled joints, closed loops and welds."""

from __future__ import annotations

from typing import Any, Final

import mujoco
import numpy as np
from numpy.typing import NDArray

_Array = NDArray[np.float64]
_E: Final = mujoco.mjtEq
_SOLVED: Final = tuple(
    int(kind) for kind in (_E.mjEQ_CONNECT, _E.mjEQ_WELD, _E.mjEQ_JOINT, _E.mjEQ_TENDON)
)
_MOST_STEPS: Final = 40
_MOST_HALVINGS: Final = 6
# Largest violation, m or rad, of a closed pose, and the one at which steps end.
_CLOSED: Final = 1e-4
_EXACT: Final = 1e-9
# Singular values below this share of the largest do not move a joint.
_SMALLEST_SHARE: Final = 1e-6
# Shares of a drawn deviation that are tried, until one can be closed.
_SHARES: Final = (1.0, 0.5, 0.25, 0.125)
# Deviations from a drawn pose, rad or m, that are tried where the file's own pose is outside its
# limits: steps get stuck at a stretched arm and at limits. Of Metaworld's Sawyer one in ten ends
# closed.
_BEND: Final = 0.6
_MOST_BENDS: Final = 40


class Closure:
    """The equalities of a model, solved by Gauss-Newton steps on MuJoCo's own Jacobian.

    Args:
        model: The model.
        movable: Whether each degree of freedom may move to close them, shape (nv,).
        limits: Indices in qpos of the hinges and slides with limits, their lower and their upper
            limits, rad or m.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        movable: NDArray[np.bool_],
        limits: tuple[NDArray[np.integer[Any]], _Array, _Array],
    ) -> None:
        self._model = model
        self._movable = movable
        self._places, self._lowest, self._highest = limits
        dofs = np.zeros(model.nq, np.intp)
        dofs[model.jnt_qposadr] = model.jnt_dofadr
        self._dofs = dofs[self._places]

    def closed(self, drawn: _Array, start: _Array, data: mujoco.MjData) -> _Array:
        """Return the closed pose next to a drawn one, shape (nq,), inside the limits.

        A pose that cannot be closed as well as the start is, is tried at smaller deviations from
        the start, and at last none. Of a start outside the limits, the pose inside them that is
        closed best is returned instead. The pose in `data` is overwritten.
        """
        goal = self._goal(start, data)
        deviation = np.zeros(self._model.nv)
        mujoco.mj_differentiatePos(self._model, deviation, 1.0, start, drawn)
        for share in _SHARES:
            pose = drawn.copy() if share == 1.0 else self._moved(start, share * deviation)
            pose, violation = self._solved(pose, data)
            if violation <= goal:
                return pose
        if np.all(start[self._places] == self._inside(start)):
            return start.copy()
        return self._bent(drawn, goal, data)

    def _bent(self, drawn: _Array, goal: float, data: mujoco.MjData) -> _Array:
        """Return the pose inside the limits that is closed best, looked for around a drawn one."""
        rng, best, least = np.random.default_rng(0), drawn, np.inf
        for _ in range(_MOST_BENDS):
            bend = np.where(self._movable, rng.uniform(-_BEND, _BEND, self._model.nv), 0.0)
            pose, violation = self._solved(self._moved(drawn, bend), data)
            if violation < least:
                best, least = pose, violation
            if least <= goal:
                break
        return best

    def holds(self, pose: _Array, start: _Array, data: mujoco.MjData) -> bool:
        """Return whether a pose (nq,) is as closed as a start pose."""
        return _largest(self._rows(pose, data)[0]) <= self._goal(start, data)

    def _goal(self, start: _Array, data: mujoco.MjData) -> float:
        """Return the largest violation of a pose that is as closed as a start pose, m or rad."""
        return max(_CLOSED, _largest(self._rows(start, data)[0]) + _EXACT)

    def still(self, pose: _Array, velocity: _Array, data: mujoco.MjData) -> _Array:
        """Return the velocity (nv,) nearest to a drawn one that keeps a pose (nq,) closed."""
        _, jacobian = self._rows(pose, data)
        return velocity - _least_squares(jacobian, jacobian @ velocity)

    def _solved(self, pose: _Array, data: mujoco.MjData) -> tuple[_Array, float]:
        """Return the nearest closed pose that steps reach, and its largest violation."""
        gaps, jacobian = self._rows(pose, data)
        for _ in range(_MOST_STEPS):
            if _largest(gaps) <= _EXACT:
                break
            step = self._step(pose, gaps, jacobian)
            for _ in range(_MOST_HALVINGS):
                tried = self._moved(pose, step)
                new_gaps, new_jacobian = self._rows(tried, data)
                if np.linalg.norm(new_gaps) < np.linalg.norm(gaps):
                    pose, gaps, jacobian = tried, new_gaps, new_jacobian
                    break
                step = 0.5 * step
            else:
                break
        return pose, _largest(gaps)

    def _step(self, pose: _Array, gaps: _Array, jacobian: _Array) -> _Array:
        """Return the smallest step, (nv,), that closes the gaps and presses at no limit."""
        free = jacobian.copy()
        step = _least_squares(free, -gaps)
        for _ in self._dofs:
            value, moved = pose[self._places], step[self._dofs]
            pressed = ((value <= self._lowest) & (moved < 0.0)) | (
                (value >= self._highest) & (moved > 0.0)
            )
            if not pressed.any():
                break
            free[:, self._dofs[pressed]] = 0.0
            step = _least_squares(free, -gaps)
        return step

    def _moved(self, pose: _Array, step: _Array) -> _Array:
        """Return a pose moved by a step (nv,), inside the limits."""
        moved = pose.copy()
        mujoco.mj_integratePos(self._model, moved, step, 1.0)
        moved[self._places] = self._inside(moved)
        return moved

    def _inside(self, pose: _Array) -> _Array:
        """Return the positions at a pose (nq,) of the limited joints, moved inside the limits."""
        return np.clip(pose[self._places], self._lowest, self._highest)

    def _rows(self, pose: _Array, data: mujoco.MjData) -> tuple[_Array, _Array]:
        """Return the violation of each equality, (n,), and its Jacobian, (n, nv)."""
        model = self._model
        data.qpos[:] = pose
        mujoco.mj_fwdPosition(model, data)
        count = int(data.ne)
        rows = np.flatnonzero(np.isin(model.eq_type[data.efc_id[:count]], _SOLVED))
        dense = np.zeros((int(data.nefc), model.nv))
        if mujoco.mj_isSparse(model):
            mujoco.mju_sparse2dense(
                dense, data.efc_J, data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind
            )
        else:
            dense[:] = data.efc_J.reshape(dense.shape)
        movable: _Array = np.where(self._movable, dense[rows], 0.0)
        return data.efc_pos[rows].copy(), movable


def _largest(gaps: _Array) -> float:
    return float(np.abs(gaps).max(initial=0.0))


def _least_squares(jacobian: _Array, wanted: _Array) -> _Array:
    """Return the smallest step (nv,) that comes nearest to the wanted change of each row."""
    # NumPy's types leave out the kind of the numbers.
    step: Any = np.linalg.pinv(jacobian, rcond=_SMALLEST_SHARE) @ wanted
    return step
