"""The physics of many worlds of one shape on a device."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Any, Final, cast

import mujoco
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from shapechanger.envs.warp.bodies import ARMS, DeviceBody, static_geoms
from shapechanger.envs.warp.contact_frames import follow_capsules
from shapechanger.envs.warp.devices import mjw, on, wp
from shapechanger.envs.warp.tendon_arms import follow_arms

_G: Final = mujoco.mjtGeom


def _pair(one: Any, other: Any) -> frozenset[int]:
    """Return the types of two geoms, in any order."""
    return frozenset((int(one), int(other)))


# The most contacts that MuJoCo makes of two geoms; 8 for all other pairs.
_CONTACTS: Final = {
    _pair(_G.mjGEOM_PLANE, _G.mjGEOM_SPHERE): 1,
    _pair(_G.mjGEOM_PLANE, _G.mjGEOM_CAPSULE): 2,
    _pair(_G.mjGEOM_PLANE, _G.mjGEOM_ELLIPSOID): 1,
    _pair(_G.mjGEOM_PLANE, _G.mjGEOM_CYLINDER): 4,
    _pair(_G.mjGEOM_PLANE, _G.mjGEOM_BOX): 4,
    _pair(_G.mjGEOM_SPHERE, _G.mjGEOM_SPHERE): 1,
    _pair(_G.mjGEOM_SPHERE, _G.mjGEOM_CAPSULE): 1,
    _pair(_G.mjGEOM_SPHERE, _G.mjGEOM_CYLINDER): 1,
    _pair(_G.mjGEOM_SPHERE, _G.mjGEOM_BOX): 1,
    _pair(_G.mjGEOM_CAPSULE, _G.mjGEOM_CAPSULE): 2,
    _pair(_G.mjGEOM_CAPSULE, _G.mjGEOM_BOX): 2,
}
_MOST_CONTACTS: Final = 8
# Most rows of one equality.
_ROWS_PER_EQUALITY: Final = 6


class Worlds:
    """Models and data of worlds whose bodies have arrays of the same shapes.

    All tensors are views of what the device steps.

    Args:
        model: A body of the batch.
        bodies: The body of each world.
        frame_skip: Physics steps of each `step`.
        device: Name of the device.
        contact_forces: Whether `cfrc_ext` is computed after each step.

    Attributes:
        qpos: Shape (n, nq).
        qvel: Shape (n, nv).
        ctrl: Shape (n, nu).
        act: States of the actuators, shape (n, na).
        actuator_force: Shape (n, nu).
        history: Former controls with their times, shape (n, nhistory).
        time: s, shape (n,).
        qacc: Shape (n, nv).
        xpos: Places of the bodies, m, shape (n, nbody, 3).
        xipos: Places of their centres of mass, m, shape (n, nbody, 3).
        cinert: Inertias of the bodies about the centre of mass of all, and masses, shape
            (n, nbody, 10).
        cvel: Velocities of the bodies, rad/s and m/s, shape (n, nbody, 6).
        qfrc_actuator: Forces of the actuators at the joints, shape (n, nv).
        ten_length: Lengths of the tendons, shape (n, ntendon).
        ten_velocity: Rates of change of these, shape (n, ntendon).
        site_xpos: Places of the sites, m, shape (n, nsite, 3).
        geom_xpos: Places of the geoms, m, shape (n, ngeom, 3).
        geom_xmat: Orientations of the geoms, shape (n, ngeom, 3, 3).
        cfrc_ext: External forces, N·m and N, shape (n, nbody, 6).
        qfrc_constraint: Forces of contacts and limits, shape (n, nv).
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        bodies: Sequence[DeviceBody],
        frame_skip: int,
        device: str,
        contact_forces: bool,
    ) -> None:
        self.count = len(bodies)
        self.device = device
        self._frame_skip = frame_skip
        self._contact_forces = contact_forces
        self._graph: Any = None
        self._warm = False
        self._static = torch.as_tensor(static_geoms(model), device=device)
        follow_capsules()
        follow_arms()
        if model.opt.solver == mujoco.mjtSolver.mjSOL_PGS:
            # mujoco-warp has no PGS. Newton's method solves the same problem, to its end.
            model = copy.copy(model)
            model.opt.solver = mujoco.mjtSolver.mjSOL_NEWTON
        with on(device):
            self._model = mjw.put_model(model)
            self._model.opt.warn_overflow = 0  # There is room for all contacts.
            contacts, rows = _room(model, self._model.nxn_geom_pair_filtered.numpy())
            self._data: Any = mjw.make_data(model, nworld=self.count, nconmax=contacts, njmax=rows)
        data = self._data
        self.qpos = self._view(data.qpos)
        self.qvel = self._view(data.qvel)
        self.ctrl = self._view(data.ctrl)
        self.act = self._view(data.act)
        self.actuator_force = self._view(data.actuator_force)
        self.history = self._view(data.history)
        self.time = self._view(data.time)
        self.qacc = self._view(data.qacc)
        self.xpos = self._view(data.xpos)
        self.xipos = self._view(data.xipos)
        self.cinert = self._view(data.cinert)
        self.cvel = self._view(data.cvel)
        self.qfrc_actuator = self._view(data.qfrc_actuator)
        self.ten_length = self._view(data.ten_length)
        self.ten_velocity = self._view(data.ten_velocity)
        self.site_xpos = self._view(data.site_xpos)
        self.geom_xpos = self._view(data.geom_xpos)
        self.geom_xmat = self._view(data.geom_xmat)
        self.cfrc_ext = self._view(data.cfrc_ext)
        self.qfrc_constraint = self._view(data.qfrc_constraint)
        # What else of the state a restart clears.
        self._cleared = [
            self._view(array)
            for array in (
                *(data.act, data.qacc_warmstart, data.ctrl, data.qvel, data.cfrc_ext),
                data.time,
            )
            if array.size
        ]
        self._rows: dict[str, Tensor] = {}
        self.write(torch.arange(self.count, device=device), bodies)

    @staticmethod
    def _view(array: Any) -> Tensor:
        return cast("Tensor", wp.to_torch(array, requires_grad=False))

    def row(self, name: str) -> Tensor:
        """Return an array of the model, shape (n or 1, ...), as of each world.

        Args:
            name: Name of a field of the model, such as `geom_size`.
        """
        return self._rows.get(name, self._by_world(name, self._array(name)))

    def _by_world(self, name: str, array: Any) -> Tensor:
        """Return an array that is not yet wide, with a leading dimension."""
        view = self._view(array)
        return view[None] if name == ARMS else view

    def _array(self, name: str) -> Any:
        owner, _, field = name.rpartition(".")
        return getattr(self._model.opt if owner else self._model, field)

    def write(self, worlds: Tensor, bodies: Sequence[DeviceBody]) -> None:
        """Give worlds other bodies.

        A field of the model gets a row per world as soon as two worlds differ in it.

        Args:
            worlds: Their indices, shape (k,).
            bodies: The body of each, with the shared arrays of this batch.
        """
        for name in bodies[0].rows:
            array = self._array(name)
            if not array.size:
                continue
            row = self._by_world(name, array)[0]
            values = _stacked([body.rows[name] for body in bodies], row)
            if name not in self._rows:
                if bool((values == row).all()):
                    continue
                self._widen(name, array)
            self._rows[name][worlds] = values
        if self._static.numel():
            for name, view in (("geom_xpos", self.geom_xpos), ("geom_xmat", self.geom_xmat)):
                like = view[0, self._static]
                values = _stacked([body.static[name] for body in bodies], like)
                view[worlds[:, None], self._static] = values

    def _widen(self, name: str, array: Any) -> None:
        """Give a field of the model one row per world."""
        shape = (self.count * array.size,) if name == ARMS else (self.count, *array.shape[1:])
        with on(self.device):
            wide = wp.empty(shape, dtype=array.dtype)
        wide._is_batched = True  # As mujoco-warp marks them.
        former = self._by_world(name, array)
        view = self._rows[name] = self._view(wide).view(self.count, *former.shape[1:])
        view[:] = former
        owner, _, field = name.rpartition(".")
        setattr(self._model.opt if owner else self._model, field, wide)
        self._graph = None  # It holds the former array.

    def clear(self, mask: Tensor) -> None:
        """Clear velocities, controls, warm starts and forces, as MuJoCo's own reset does.

        Args:
            mask: Which worlds, shape (n,).
        """
        for view in self._cleared:
            view[mask] = 0.0

    def step(self) -> None:
        """Step the physics of an action."""
        with on(self.device):
            if self.device == "cpu" or not self._warm:
                # The first steps compile kernels, which cannot be captured.
                self._step()
                self._warm = True
                return
            if self._graph is None:
                # Torch's usual stream is CUDA's legacy one, which cannot be captured.
                with wp.ScopedStream(wp.Stream(self.device)), wp.ScopedCapture() as capture:
                    self._step()
                self._graph = capture.graph
            wp.capture_launch(self._graph)

    def _step(self) -> None:
        for _ in range(self._frame_skip):
            mjw.step(self._model, self._data)
        if self._contact_forces:
            mjw.rne_postconstraint(self._model, self._data)

    def kinematics(self) -> None:
        """Compute the places of bodies, geoms and sites from `qpos`."""
        with on(self.device):
            mjw.kinematics(self._model, self._data)

    def forward(self) -> None:
        """Compute all that follows from the state, forces included."""
        with on(self.device):
            mjw.forward(self._model, self._data)


def _stacked(arrays: Sequence[NDArray[Any]], like: Tensor) -> Tensor:
    """Return arrays as one tensor, shape (k, ...), with shape, dtype and device of a row."""
    stacked = np.stack(arrays).reshape(len(arrays), *like.shape)
    return torch.as_tensor(stacked, dtype=like.dtype, device=like.device)


def _room(model: mujoco.MjModel, pairs: NDArray[Any]) -> tuple[int, int]:
    """Return how many contacts, and rows of constraints, a world can have at the most.

    Args:
        model: The model.
        pairs: Geoms that can touch, shape (k, 2).
    """
    contacts = rows = 0
    for pair in pairs.tolist():
        kinds = _pair(*(model.geom_type[geom] for geom in pair))
        count = _CONTACTS.get(kinds, _MOST_CONTACTS)
        condim = max(int(model.geom_condim[geom]) for geom in pair)
        condim = max([condim, *model.pair_dim.tolist()])
        contacts += count
        rows += count * max(1, 2 * (condim - 1))
    rows += int(model.jnt_limited.sum()) + 2 * int(model.ntendon)
    rows += int(np.count_nonzero(model.dof_frictionloss)) and int(model.nv)
    return max(1, contacts), max(1, rows + _ROWS_PER_EQUALITY * int(model.neq))
