"""The physics of many worlds of one shape on a device."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import mujoco
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from shapechanger.envs.warp.bodies import ARMS, DeviceBody, static_geoms
from shapechanger.envs.warp.devices import as_torch, mjw, on, wp
from shapechanger.envs.warp.patches import follow_mujoco

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
# Arrays of the data that are attributes of `Worlds`.
_ARRAYS: Final = (
    *("qpos", "qvel", "qacc", "qfrc_actuator", "qfrc_constraint", "ctrl", "actuator_force", "act"),
    *("history", "time", "xpos", "xipos", "cinert", "cvel", "cfrc_ext", "ten_length"),
    *("ten_velocity", "site_xpos", "geom_xpos", "geom_xmat"),
)
# Most rows of one equality.
_ROWS_PER_EQUALITY: Final = 6
# Overflows of the memory for contacts and constraints, by which results are wrong.
_OVERFLOWS: Final = {
    "njmax": ("NEFC", "NJMAX_NNZ"),
    "nconmax": ("BROADPHASE", "NARROWPHASE", "CCD"),
}


class Worlds:
    """Models and data of worlds whose bodies have arrays of the same shapes.

    Arrays of MuJoCo's data are attributes with its names and units, as views with a row per world:
    `qpos` (n, nq), `qvel`, `qacc`, `qfrc_actuator` and `qfrc_constraint` (n, nv), `ctrl` and
    `actuator_force` (n, nu), `act` (n, na), `history` (n, nhistory), `time` (n,), `xpos` and
    `xipos` (n, nbody, 3), `cinert` (n, nbody, 10), `cvel` and `cfrc_ext` (n, nbody, 6),
    `ten_length` and `ten_velocity` (n, ntendon), `site_xpos` (n, nsite, 3), `geom_xpos`
    (n, ngeom, 3) and `geom_xmat` (n, ngeom, 3, 3).

    Args:
        model: A body of the batch.
        bodies: The bodies that worlds can have.
        numbers: The body of each world, an index of `bodies`, shape (n,).
        frame_skip: Physics steps of each `step`.
        device: Name of the device.
        contact_forces: Whether `cfrc_ext` is computed after each step.
        limits: How many contacts (`nconmax`) and rows of constraints (`njmax`) a world has memory
            for; as many as it can ever have where a number is missing.

    Attributes:
        limits: How many contacts and rows of constraints a world has memory for.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        bodies: Sequence[DeviceBody],
        numbers: Tensor,
        frame_skip: int,
        device: str,
        contact_forces: bool,
        limits: Mapping[str, int],
    ) -> None:
        self.count = len(numbers)
        self.device = device
        self._frame_skip = frame_skip
        self._contact_forces = contact_forces
        # The graph of each function, and the functions whose kernels are loaded.
        self._graphs: dict[str, Any] = {}
        self._warm: set[str] = set()
        self._static = torch.as_tensor(static_geoms(model), device=device)
        follow_mujoco()
        if model.opt.solver == mujoco.mjtSolver.mjSOL_PGS:
            # mujoco-warp has no PGS. Newton's method solves the same problem, to its end.
            model = copy.copy(model)
            model.opt.solver = mujoco.mjtSolver.mjSOL_NEWTON
        with on(device):
            self._model = mjw.put_model(model)
            self._model.opt.warn_overflow = 0  # `overflows` reports them without printing.
            most = _room(model, self._model.nxn_geom_pair_filtered.numpy())
            self.limits = {**most, **limits}
            self._data: Any = mjw.make_data(model, nworld=self.count, **self.limits)
        data = self._data
        self._overflow = as_torch(data.overflow)
        for name in _ARRAYS:
            setattr(self, name, as_torch(getattr(data, name)))
        # What else of the state a restart clears.
        self._cleared = [
            as_torch(array)
            for array in (
                *(data.act, data.qacc_warmstart, data.ctrl, data.qvel, data.cfrc_ext),
                data.time,
            )
            if array.size
        ]
        # Fields with a row per world, and for each the rows of the bodies that worlds can have.
        self._rows: dict[str, Tensor] = {}
        self._tables: dict[str, Tensor] = {}
        self._static_tables: dict[str, Tensor] = {}
        self.hold(bodies)
        self.choose(numbers)

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Tensor: ...

    def row(self, name: str) -> Tensor:
        """Return an array of the model, shape (n or 1, ...), as of each world.

        Args:
            name: Name of a field of the model, such as `geom_size`.
        """
        return self._rows.get(name, self._by_world(name, self._array(name)))

    def _by_world(self, name: str, array: Any) -> Tensor:
        """Return an array that is not yet wide, with a leading dimension."""
        view = as_torch(array)
        return view[None] if name == ARMS else view

    def _array(self, name: str) -> Any:
        owner, _, field = name.rpartition(".")
        return getattr(self._model.opt if owner else self._model, field)

    def hold(self, bodies: Sequence[DeviceBody]) -> None:
        """Keep the numbers of bodies on the device, from which `choose` gathers.

        A field of the model gets a row per world as soon as two bodies differ in it.

        Args:
            bodies: The bodies, with the shared arrays of this batch.
        """
        for name in bodies[0].rows:
            array = self._array(name)
            if not array.size:
                continue
            row = self._by_world(name, array)[0]
            table = _stacked([body.rows[name] for body in bodies], row)
            if name not in self._rows:
                if bool((table == row).all()):
                    continue
                self._widen(name, array)
            self._tables[name] = table
        if self._static.numel():
            for name, view in (("geom_xpos", self.geom_xpos), ("geom_xmat", self.geom_xmat)):
                like = view[0, self._static]
                self._static_tables[name] = _stacked([body.static[name] for body in bodies], like)

    def choose(self, numbers: Tensor) -> None:
        """Give each world one of the held bodies, without asking the device anything.

        Args:
            numbers: Indices of the held bodies, shape (n,).
        """
        for name, table in self._tables.items():
            self._rows[name].copy_(table[numbers])
        for name, table in self._static_tables.items():
            getattr(self, name)[:, self._static] = table[numbers]

    def overflows(self) -> dict[str, int]:
        """Return in how many worlds the memory was too small since the last call, by limit."""
        flags = self._overflow.clone()
        self._overflow.zero_()
        found: dict[str, int] = {}
        for limit, names in _OVERFLOWS.items():
            bits = sum(int(getattr(mjw.OverflowType, name)) for name in names)
            count = int((flags & bits != 0).sum())
            if count:
                found[limit] = count
        return found

    def _widen(self, name: str, array: Any) -> None:
        """Give a field of the model one row per world."""
        shape = (self.count * array.size,) if name == ARMS else (self.count, *array.shape[1:])
        with on(self.device):
            wide = wp.empty(shape, dtype=array.dtype)
        wide._is_batched = True  # As mujoco-warp marks them.
        former = self._by_world(name, array)
        view = self._rows[name] = as_torch(wide).view(self.count, *former.shape[1:])
        view[:] = former
        owner, _, field = name.rpartition(".")
        setattr(self._model.opt if owner else self._model, field, wide)
        self._graphs.clear()  # They hold the former array.
        self._warm.clear()  # Some kernels depend on which arrays are wide.

    def clear(self, mask: Tensor) -> None:
        """Clear velocities, controls, warm starts and forces, as MuJoCo's own reset does.

        Args:
            mask: Which worlds, shape (n,).
        """
        for view in self._cleared:
            view.masked_fill_(mask.view(-1, *[1] * (view.dim() - 1)), 0.0)

    def step(self) -> None:
        """Step the physics of an action."""
        self._run("step", self._step)

    def _run(self, name: str, function: Callable[[], None]) -> None:
        """Run a function of the device, as a graph from the second time on."""
        with on(self.device):
            if name not in self._warm:
                # The first call compiles kernels.
                function()
                self._warm.add(name)
                return
            if name not in self._graphs:
                # Torch's usual stream is CUDA's legacy one, which cannot be captured.
                own = None if self.device == "cpu" else wp.Stream(self.device)
                with wp.ScopedStream(own), wp.ScopedCapture() as capture:
                    function()
                self._graphs[name] = capture.graph
            wp.capture_launch(self._graphs[name])

    def _step(self) -> None:
        for _ in range(self._frame_skip):
            mjw.step(self._model, self._data)
        if self._contact_forces:
            mjw.rne_postconstraint(self._model, self._data)

    def kinematics(self) -> None:
        """Compute the places of bodies, geoms and sites from `qpos`."""
        self._run("kinematics", lambda: mjw.kinematics(self._model, self._data))

    def forward(self) -> None:
        """Compute all that follows from the state, forces included."""
        self._run("forward", lambda: mjw.forward(self._model, self._data))


def _stacked(arrays: Sequence[NDArray[Any]], like: Tensor) -> Tensor:
    """Return arrays as one tensor, shape (k, ...), with shape, dtype and device of a row."""
    stacked = np.stack(arrays).reshape(len(arrays), *like.shape)
    return torch.as_tensor(stacked, dtype=like.dtype, device=like.device)


def _room(model: mujoco.MjModel, pairs: NDArray[Any]) -> dict[str, int]:
    """Return the most contacts (`nconmax`) and rows of constraints (`njmax`) of a world.

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
    rows += _ROWS_PER_EQUALITY * int(model.neq)
    return {"nconmax": max(1, contacts), "njmax": max(1, rows)}
