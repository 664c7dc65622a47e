"""Bodies read for a device, and the worlds of a batch, whose bodies share `DeviceBody.shared`."""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Final, NamedTuple, cast

import gymnasium as gym
import mujoco
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from shapechanger.envs.warp.devices import as_torch, mjw, on, wp
from shapechanger.envs.warp.kernels import uniforms
from shapechanger.errors import VectorEnvError
from shapechanger.layout import Layout

Infos = dict[str, Tensor]
"""Tensors with a row per world, keyed by name."""

_MOST_LISTED: Final = 4
# Stream of the random numbers that choose bodies; tasks use the streams from 0 on.
_BODIES: Final = -1
# Arrays of the data that are attributes of `Worlds`.
_ARRAYS: Final = (
    *("qpos", "qvel", "qacc", "qfrc_actuator", "qfrc_constraint", "ctrl", "actuator_force", "act"),
    *("history", "time", "xpos", "xipos", "cinert", "cvel", "cfrc_ext", "ten_length"),
    *("ten_velocity", "site_xpos", "geom_xpos", "geom_xmat"),
)
# Parts of the state that a restart sets to 0; it sets the positions to the start pose.
_CLEARED: Final = ("act", "qacc_warmstart", "ctrl", "qvel", "cfrc_ext", "time")
# Overflows of the memory for contacts and constraints, which make results wrong.
_OVERFLOWS: Final = ("NEFC", "NJMAX_NNZ", "BROADPHASE", "NARROWPHASE", "CCD")
# Largest number of contacts of two geoms of which one has the shape; "" for all other shapes.
_MOST_CONTACTS: Final = {"SPHERE": 1, "CAPSULE": 2, "": 8}
# Most rows of one equality.
_ROWS_PER_EQUALITY: Final = 6


Rows = Mapping[str, NDArray[Any]]
"""Arrays of one body, keyed by name."""

ARMS: Final = "wrap_prm"
"""Moment arms of tendons over joints, which may differ between worlds; see `kernels`."""
# Beginnings of names of fields that only rendering, sleeping bodies and sensors use, not the tasks.
_UNREAD: Final = (
    *("cam_", "light_", "mat_", "geom_rgba", "geom_matid", "geom_group", "site_type"),
    *("dof_length", "site_size"),
)


class DeviceBody(NamedTuple):
    """Arrays of a body for a device.

    Attributes:
        name: Its name or edits, for messages.
        shared: Numbers and arrays that all worlds of a batch have in common, as bytes.
        rows: Arrays that may differ between worlds; names of options begin with `opt.`.
        static: Places and orientations of the geoms that never move, which the device's kinematics
            leaves as they are: `geom_xpos` (k, 3) and `geom_xmat` (k, 3, 3).
        constants: Numbers of the task that depend on the body.
    """

    name: str
    shared: Mapping[str, bytes]
    rows: Rows
    static: Rows
    constants: Rows


def device_body(name: str, model: mujoco.MjModel, constants: Rows) -> DeviceBody:
    """Read a compiled body, as mujoco-warp reads it; other arguments as for `DeviceBody`."""
    with on("cpu"):
        made = mjw.put_model(model)
    rows: dict[str, NDArray[Any]] = {}
    shared: dict[str, bytes] = {}
    for prefix, owner in (("", made), ("opt.", made.opt)):
        for field in dataclasses.fields(owner):
            key, kind = prefix + field.name, cast("Any", field.type)
            if field.name.startswith(_UNREAD):
                continue
            if kind is int or kind is bool:
                shared[key] = str(int(getattr(owner, field.name))).encode()
            elif isinstance(kind, wp.array):
                array = getattr(owner, field.name).numpy()
                is_row = kind.shape[0] == "*"
                if key == ARMS:  # For a pulley, this array contains the divisor.
                    is_row = bool((model.wrap_type == mujoco.mjtWrap.mjWRAP_JOINT).all())
                if is_row:
                    rows[key] = array
                shared[key] = str(array.shape).encode() + (b"" if is_row else array.tobytes())
    # Which of these are zero in a batch's first body decides the memory for constraints.
    for key in ("dof_frictionloss", "tendon_frictionloss"):
        shared[f"zeros of {key}"] = (getattr(model, key) > 0.0).tobytes()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    fixed = static_geoms(model)
    places = {"geom_xpos": data.geom_xpos[fixed]}
    places["geom_xmat"] = data.geom_xmat[fixed].reshape(-1, 3, 3)
    return DeviceBody(name, shared, rows, places, constants)


def static_geoms(model: mujoco.MjModel) -> NDArray[np.intp]:
    """Return the indices of the geoms that are fixed to the world."""
    return np.flatnonzero(model.body_weldid[model.geom_bodyid] == 0)


def geom_type(model: mujoco.MjModel, geom: int) -> str:
    """Return the name of a geom's shape, such as `CAPSULE`."""
    return mujoco.mjtGeom(int(model.geom_type[geom])).name.removeprefix("mjGEOM_")


def differing_arrays(one: DeviceBody, other: DeviceBody) -> list[str]:
    """Return the names of the arrays because of which two bodies cannot share a batch."""
    names = {**one.shared, **other.shared}
    return [name for name in names if one.shared.get(name) != other.shared.get(name)]


class Worlds(ABC):
    """Worlds that are stepped together, because their bodies have equal `DeviceBody.shared`.

    A subclass is a task: start, action, observation, reward and end as functions of tensors.

    Arrays of MuJoCo's data are attributes with its names and units, as views with a row per world:
    `qpos` (n, nq), `qvel`, `qacc`, `qfrc_actuator` and `qfrc_constraint` (n, nv), `ctrl` and
    `actuator_force` (n, nu), `act` (n, na), `history` (n, nhistory), `time` (n,), `xpos` and
    `xipos` (n, nbody, 3), `cinert` (n, nbody, 10), `cvel` and `cfrc_ext` (n, nbody, 6),
    `ten_length` and `ten_velocity` (n, ntendon), `site_xpos` (n, nsite, 3),
    `geom_xpos` (n, ngeom, 3) and `geom_xmat` (n, ngeom, 3, 3).

    Args:
        env: A CPU env of the task, which reads the bodies.
        model: The compiled model of the first body.
        frame_skip: Physics steps of each `simulate`.
        layouts: Layouts of observations and actions with the first body.
        numbers: The number of each world in the vector env.
        bodies: The bodies that the worlds can have, keyed by their edits.
        each: The edits of each world's body.
        redraws: Whether each start of an episode draws one of the bodies.
        limits: How many contacts (`nconmax`) and rows of constraints (`njmax`) a world has memory
            for; a missing number is the largest possible one.

    Attributes:
        chosen: The body of each world, an index of `bodies`, shape (n,).
        constants: Numbers of the task of each world's body, shape (n, ...).
        precision: Type of the constants.
        contact_forces: Whether the task reads `cfrc_ext`.
        start_forces: Whether the first observation reads forces.
    """

    precision: ClassVar[torch.dtype] = torch.float32
    contact_forces: ClassVar[bool] = False
    start_forces: ClassVar[bool] = False

    def __init__(
        self,
        env: Any,
        model: mujoco.MjModel,
        frame_skip: int,
        layouts: tuple[Layout, Layout],
        numbers: Sequence[int],
        bodies: Mapping[Any, DeviceBody],
        each: Sequence[Any],
        device: str,
        *,
        redraws: bool,
        limits: Mapping[str, int],
    ) -> None:
        self._env, self.model, self._frame_skip = env, model, frame_skip
        self.numbers = torch.tensor(numbers, device=device)
        self.count, self.device = len(numbers), device
        self.observation_layout, self.action_layout = layouts
        size = (self.observation_layout.size,)
        self.single_observation_space = gym.spaces.Box(-np.inf, np.inf, size, np.float32)
        self.single_action_space: gym.spaces.Box = env.action_space
        self._redraws = redraws
        # The graph of each function, and the functions whose kernels are loaded.
        self._graphs: dict[str, Any] = {}
        self._warm: set[str] = set()
        with on(device):
            self._model = mjw.put_model(model)
            self._model.opt.warn_overflow = 0  # `overflows` reports them without printing.
            self.limits = _room(model, self._model.nxn_geom_pair_filtered.numpy()) | {**limits}
            self._data: Any = mjw.make_data(model, nworld=self.count, **self.limits)
        for name in _ARRAYS:
            setattr(self, name, as_torch(getattr(self._data, name)))
        self._overflow = as_torch(self._data.overflow)
        cleared = [getattr(self._data, name) for name in _CLEARED]
        self._cleared = [as_torch(array) for array in cleared if array.size]
        # Fields of the model with a row per world.
        self._rows: dict[str, Tensor] = {}
        self.constants: dict[str, Tensor] = {}
        # Data that depend on a world's body: tensor, index into it, and the rows of all bodies.
        self._tables: dict[str, tuple[Tensor, Any, Tensor]] = {}
        self.change_bodies(bodies, each)
        self._before = self.place().clone()

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Tensor: ...

    @abstractmethod
    def begin(self, mask: Tensor, seeds: Tensor, episodes: Tensor) -> None:
        """Put worlds with a cleared state into start states; arguments as for `start`."""

    def apply(self, actions: Tensor) -> None:
        """Apply actions, shape (n, nu), and step the physics."""
        self.ctrl[:] = actions
        self.simulate()

    def place(self) -> Tensor:
        """Return the part of the state before the physics that the reward needs (a view)."""
        return self.qpos[:, :0]

    @abstractmethod
    def observations(self) -> Tensor:
        """Return the observations, shape (n, size)."""

    @abstractmethod
    def outcome(self, before: Tensor, actions: Tensor) -> tuple[Tensor, Tensor, Infos]:
        """Return rewards, shape (n,), terminations, (n,), and infos of a step.

        `before` is the result of `place` before the physics; actions have the shape (n, nu).
        """

    def start_infos(self) -> Infos:
        """Return the infos of a reset."""
        return {}

    def row(self, name: str) -> Tensor:
        """Return a field of the model for all worlds, such as `geom_size`, (n or 1, ...)."""
        if name in self._rows:
            return self._rows[name]
        owner, field = self._field(name)
        view = as_torch(getattr(owner, field))
        return view[None] if name == ARMS else view

    def _field(self, name: str) -> tuple[Any, str]:
        """Return the object that has a field of the model, and the name of the field in it."""
        part, _, field = name.rpartition(".")
        return (self._model.opt if part else self._model), field

    def require_fitting(self, body: DeviceBody) -> None:
        """Raise a VectorEnvError unless a body has the arrays of these worlds."""
        first = next(iter(self.bodies.values()))
        if arrays := differing_arrays(first, body):
            raise VectorEnvError(
                f"{body.name} cannot join the batch of {first.name}, because "
                f"{', '.join(arrays[:_MOST_LISTED])} differ: worlds of one batch share these "
                "arrays, so make the vector env with both bodies, which gives it a batch of each."
            )

    def change_bodies(self, bodies: Mapping[Any, DeviceBody], each: Sequence[Any]) -> None:
        """Replace the bodies that worlds can have; worlds whose body changes must start again.

        The numbers of all bodies stay on the device, from which `_choose` gathers. A field of the
        model gets a row per world as soon as two bodies differ in it. Bodies are keyed by their
        edits, and `each` has the edits of each world's body.
        """
        self.bodies = bodies
        held = [*bodies.values()]
        for name in held[0].rows:
            row = self.row(name)[0]
            if not row.numel():
                continue
            table = _stacked([body.rows[name] for body in held], row)
            if name not in self._rows:
                if bool((table == row).all()):
                    continue
                self._widen(name)
            self._tables[name] = self._rows[name], ..., table
        fixed = torch.as_tensor(static_geoms(self.model), device=self.device)
        for name, view in (("geom_xpos", self.geom_xpos), ("geom_xmat", self.geom_xmat)):
            table = _stacked([body.static[name] for body in held], view[0, fixed])
            self._tables[name] = view, (slice(None), fixed), table
        for name in held[0].constants:
            rows = np.stack([body.constants[name] for body in held])
            table = torch.as_tensor(rows, dtype=self.precision, device=self.device)
            if name not in self.constants:
                self.constants[name] = table.new_empty((self.count, *table.shape[1:]))
            self._tables[f"constant {name}"] = self.constants[name], ..., table
        place = {body: i for i, body in enumerate(bodies)}
        self._choose(torch.tensor([place[body] for body in each], device=self.device))

    def _choose(self, chosen: Tensor) -> None:
        """Give each world one of the stored bodies, without synchronisation with the device."""
        self.chosen = chosen
        for target, part, table in self._tables.values():
            target[part] = table[chosen]

    def _widen(self, name: str) -> None:
        """Give a field of the model one row per world."""
        owner, field = self._field(name)
        array, former = getattr(owner, field), self.row(name)
        shape = (self.count * array.size,) if name == ARMS else (self.count, *array.shape[1:])
        with on(self.device):
            wide = wp.empty(shape, dtype=array.dtype)
        wide._is_batched = True  # The mark of mujoco-warp for such arrays.
        view = self._rows[name] = as_torch(wide).view(self.count, *former.shape[1:])
        view[:] = former
        setattr(owner, field, wide)
        self._graphs.clear()  # The graphs refer to the former array.
        self._warm.clear()  # Some kernels depend on which arrays are wide.

    def step(self, actions: Tensor) -> tuple[Tensor, dict[str, Tensor], Infos]:
        """Take one step of the task in each world, with actions of shape (n, nu).

        A world whose simulation has diverged is terminated with the reward 0, and put back to its
        pose at rest at once, so that only its own results are lost. Return observations,
        shape (n, size); `rewards`, `terminated` and `diverged`, shape (n,) each; and infos.
        """
        actions = actions.detach()
        self.apply(actions)
        rewards, terminated, infos = self.outcome(self._before, actions)
        observations = self.observations()
        self._before = self.place().clone()
        state = torch.cat([self.qpos, self.qvel, self.qacc], dim=1)
        # A NaN counts as diverged too.
        bounded = (state.abs() <= mujoco.mjMAXVAL).all(dim=1)
        diverged = ~(bounded & observations.isfinite().all(dim=1))
        observations = observations.masked_fill(~observations.isfinite(), 0.0)
        self._clear(diverged)
        poses = self.constants["init_qpos"].to(self.qpos.dtype)
        self.qpos.copy_(torch.where(diverged[:, None], poses, self.qpos))
        ends = {"rewards": rewards.masked_fill(diverged, 0.0), "terminated": terminated | diverged}
        return observations, {**ends, "diverged": diverged}, infos

    def start(self, mask: Tensor, seeds: Tensor, episodes: Tensor) -> tuple[Tensor, Infos]:
        """Start an episode in the worlds of a mask, shape (n,); other arguments as for `uniforms`.

        Return observations, shape (n, size), and infos; only the rows of the mask show a start.
        """
        self._clear(mask)
        if self._redraws:
            drawn = uniforms(seeds, episodes, _BODIES, 1)[:, 0] * len(self.bodies)
            self._choose(torch.where(mask, drawn.to(torch.int64), self.chosen))
        self.begin(mask, seeds, episodes)
        return self._started(mask)

    def _started(self, mask: Tensor) -> tuple[Tensor, Infos]:
        if self.start_forces:
            self.forward()
        else:
            self.kinematics()
        self._before = torch.where(mask[:, None], self.place(), self._before)
        return self.observations(), self.start_infos()

    def _clear(self, mask: Tensor) -> None:
        """Set the arrays in `_CLEARED` of masked worlds to 0, as MuJoCo's own reset does."""
        for view in self._cleared:
            view.masked_fill_(mask.view(-1, *[1] * (view.dim() - 1)), 0.0)

    def simulate(self) -> None:
        """Step the physics `frame_skip` times."""
        self._run("simulate", self._simulate)

    def _simulate(self) -> None:
        for _ in range(self._frame_skip):
            mjw.step(self._model, self._data)
        if self.contact_forces:
            mjw.rne_postconstraint(self._model, self._data)

    def kinematics(self) -> None:
        """Compute the places of bodies, geoms and sites from `qpos`."""
        self._run("kinematics", lambda: mjw.kinematics(self._model, self._data))

    def forward(self) -> None:
        """Compute all quantities that depend on the state, including forces."""
        self._run("forward", lambda: mjw.forward(self._model, self._data))

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

    def overflows(self) -> int:
        """Return in how many worlds the memory was too small since the last call."""
        bits = sum(int(getattr(mjw.OverflowType, name)) for name in _OVERFLOWS)
        count = int((self._overflow & bits != 0).sum())
        self._overflow.zero_()
        return count


def _stacked(arrays: Sequence[NDArray[Any]], like: Tensor) -> Tensor:
    """Return arrays as one tensor, shape (k, ...), with shape, dtype and device of a row."""
    stacked = np.stack(arrays).reshape(len(arrays), *like.shape)
    return torch.as_tensor(stacked, dtype=like.dtype, device=like.device)


def _room(model: mujoco.MjModel, pairs: NDArray[Any]) -> dict[str, int]:
    """Return the largest number of contacts and constraint rows if these pairs (k, 2) can touch."""
    contacts = rows = 0
    for pair in pairs.tolist():
        kinds = {geom_type(model, geom) for geom in pair}
        count = next(most for kind, most in _MOST_CONTACTS.items() if not kind or kind in kinds)
        condim = int(max([*model.geom_condim[pair], *model.pair_dim]))
        contacts += count
        rows += count * max(1, 2 * (condim - 1))
    rows += int(model.jnt_limited.sum()) + 2 * int(model.ntendon)
    rows += int(np.count_nonzero(model.dof_frictionloss)) and int(model.nv)
    rows += _ROWS_PER_EQUALITY * int(model.neq)
    return {"nconmax": max(1, contacts), "njmax": max(1, rows)}
