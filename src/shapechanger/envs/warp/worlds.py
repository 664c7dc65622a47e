"""Worlds of one batch: bodies whose arrays have the same shapes, their physics and their task."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import gymnasium as gym
import mujoco
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from shapechanger.envs.warp.bodies import (
    ARMS,
    DeviceBody,
    differing_arrays,
    geom_type,
    static_geoms,
)
from shapechanger.envs.warp.devices import as_torch, mjw, on, without_gradients, wp
from shapechanger.envs.warp.kernels import follow_mujoco, uniforms
from shapechanger.errors import VectorEnvError

_MOST_LISTED: Final = 4
# Stream of the random numbers that choose bodies; tasks use those from 0 on.
_BODIES: Final = -1
# Arrays of the data that are attributes of `Worlds`.
_ARRAYS: Final = (
    *("qpos", "qvel", "qacc", "qfrc_actuator", "qfrc_constraint", "ctrl", "actuator_force", "act"),
    *("history", "time", "xpos", "xipos", "cinert", "cvel", "cfrc_ext", "ten_length"),
    *("ten_velocity", "site_xpos", "geom_xpos", "geom_xmat"),
)
# Parts of the state that a restart clears, in addition to the positions.
_CLEARED: Final = ("act", "qacc_warmstart", "ctrl", "qvel", "cfrc_ext", "time")
# Overflows of the memory for contacts and constraints, by which results are wrong.
_OVERFLOWS: Final = ("NEFC", "NJMAX_NNZ", "BROADPHASE", "NARROWPHASE", "CCD")
# The most contacts that MuJoCo makes of two geoms of which one has such a shape, and of others.
_MOST_CONTACTS: Final = {"SPHERE": 1, "CAPSULE": 2, "": 8}
# Most rows of one equality.
_ROWS_PER_EQUALITY: Final = 6


class DeviceOutcome(NamedTuple):
    """Rewards, ends and infos of a step.

    Attributes:
        rewards: Shape (n,).
        terminated: Shape (n,).
        infos: Tensors of shape (n, ...).
    """

    rewards: Tensor
    terminated: Tensor
    infos: dict[str, Tensor]


class Worlds:
    """Worlds whose bodies have arrays of the same shapes, which are stepped together.

    Arrays of MuJoCo's data are attributes with its names and units, as views with a row per world:
    `qpos` (n, nq), `qvel`, `qacc`, `qfrc_actuator` and `qfrc_constraint` (n, nv), `ctrl` and
    `actuator_force` (n, nu), `act` (n, na), `history` (n, nhistory), `time` (n,), `xpos` and
    `xipos` (n, nbody, 3), `cinert` (n, nbody, 10), `cvel` and `cfrc_ext` (n, nbody, 6),
    `ten_length` and `ten_velocity` (n, ntendon), `site_xpos` (n, nsite, 3), `geom_xpos`
    (n, ngeom, 3) and `geom_xmat` (n, ngeom, 3, 3).

    Args:
        task: Their `DeviceTask`.
        numbers: The number of each world in the vector env.
        bodies: The bodies that the worlds can have, keyed by their edits.
        each: The edits of each world's body.
        device: Name of the device.
        redraws: Whether each start of an episode draws one of the bodies.
        limits: How many contacts (`nconmax`) and rows of constraints (`njmax`) a world has memory
            for; the largest possible number where one is missing.

    Attributes:
        count: How many worlds there are.
        bodies: The bodies that the worlds can have, keyed by their edits.
        chosen: The body of each world, an index of `bodies`, shape (n,).
        constants: Numbers of the task of each world's body, shape (n, ...).
        limits: How many contacts and rows of constraints a world has memory for.
        observation_layout: Name, unit and range of each number of an observation.
        action_layout: Name, unit and range of each number of an action.
        single_observation_space: Space of one world's observations, float32.
        single_action_space: Space of one world's actions.
    """

    def __init__(
        self,
        task: Any,
        numbers: Sequence[int],
        bodies: Mapping[Any, DeviceBody],
        each: Sequence[Any],
        device: str,
        *,
        redraws: bool,
        limits: Mapping[str, int],
    ) -> None:
        self.task = task
        self.numbers = torch.tensor(numbers, device=device)
        self.count, self.device = len(numbers), device
        self.observation_layout, self.action_layout = task.observation_layout, task.action_layout
        size = (task.observation_layout.size,)
        self.single_observation_space = gym.spaces.Box(-np.inf, np.inf, size, np.float32)
        self.single_action_space = task.action_space
        self._redraws = redraws
        # The graph of each function, and the functions whose kernels are loaded.
        self._graphs: dict[str, Any] = {}
        self._warm: set[str] = set()
        model = task.model
        self._static = torch.as_tensor(static_geoms(model), device=device)
        follow_mujoco()
        if model.opt.solver == mujoco.mjtSolver.mjSOL_PGS:
            # mujoco-warp has no PGS. Newton's method solves the same problem, to its end.
            model = copy.copy(model)
            model.opt.solver = mujoco.mjtSolver.mjSOL_NEWTON
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
        # Fields of the model with a row per world, and the rows of each body for these, for the
        # constants, and for the places of static geoms.
        self._rows: dict[str, Tensor] = {}
        self.constants: dict[str, Tensor] = {}
        self._tables: dict[str, Tensor] = {}
        self._constant_tables: dict[str, Tensor] = {}
        self._static_tables: dict[str, Tensor] = {}
        self.change_bodies(bodies, each)
        task.attach(self)
        self._before = task.place(self).clone()

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Tensor: ...

    def row(self, name: str) -> Tensor:
        """Return a field of the model for all worlds, such as `geom_size`, (n or 1, ...)."""
        return self._rows.get(name, self._by_world(name, self._array(name)))

    def _by_world(self, name: str, array: Any) -> Tensor:
        """Return an array that is not yet wide, with a leading dimension."""
        view = as_torch(array)
        return view[None] if name == ARMS else view

    def _array(self, name: str) -> Any:
        owner, _, field = name.rpartition(".")
        return getattr(self._model.opt if owner else self._model, field)

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
        """Replace the bodies that worlds can have; worlds with another one must start again.

        The numbers of all bodies stay on the device, from which `_choose` gathers. A field of the
        model gets a row per world as soon as two bodies differ in it.

        Args:
            bodies: The bodies, keyed by their edits.
            each: The edits of each world's body.
        """
        self.bodies = bodies
        held = [*bodies.values()]
        for name in held[0].rows:
            array = self._array(name)
            if not array.size:
                continue
            row = self._by_world(name, array)[0]
            table = _stacked([body.rows[name] for body in held], row)
            if name not in self._rows:
                if bool((table == row).all()):
                    continue
                self._widen(name, array)
            self._tables[name] = table
        if self._static.numel():
            for name, view in (("geom_xpos", self.geom_xpos), ("geom_xmat", self.geom_xmat)):
                like = view[0, self._static]
                self._static_tables[name] = _stacked([body.static[name] for body in held], like)
        for name in held[0].constants:
            rows = np.stack([body.constants[name] for body in held])
            table = torch.as_tensor(rows, dtype=self.task.precision, device=self.device)
            self._constant_tables[name] = table
            if name not in self.constants:
                self.constants[name] = table.new_empty((self.count, *table.shape[1:]))
        place = {body: i for i, body in enumerate(bodies)}
        self._choose(torch.tensor([place[body] for body in each], device=self.device))

    def _choose(self, chosen: Tensor) -> None:
        """Give each world one of the stored bodies, without synchronisation with the device."""
        self.chosen = chosen
        for name, table in self._tables.items():
            self._rows[name].copy_(table[chosen])
        for name, table in self._static_tables.items():
            getattr(self, name)[:, self._static] = table[chosen]
        for name, table in self._constant_tables.items():
            self.constants[name].copy_(table[chosen])

    def _widen(self, name: str, array: Any) -> None:
        """Give a field of the model one row per world."""
        shape = (self.count * array.size,) if name == ARMS else (self.count, *array.shape[1:])
        with on(self.device):
            wide = wp.empty(shape, dtype=array.dtype)
        wide._is_batched = True  # The mark of mujoco-warp for such arrays.
        former = self._by_world(name, array)
        view = self._rows[name] = as_torch(wide).view(self.count, *former.shape[1:])
        view[:] = former
        owner, _, field = name.rpartition(".")
        setattr(self._model.opt if owner else self._model, field, wide)
        self._graphs.clear()  # They hold the former array.
        self._warm.clear()  # Some kernels depend on which arrays are wide.

    def step(self, actions: Tensor) -> tuple[Tensor, DeviceOutcome, Tensor]:
        """Take one step of the task in each world.

        A world whose simulation has diverged is terminated with the reward 0, and put back to its
        pose at rest at once, so that only its own results are lost.

        Args:
            actions: Shape (n, nu).

        Returns:
            Observations, shape (n, size); rewards, ends and infos; and which worlds have diverged,
            shape (n,).
        """
        task, actions = self.task, actions.detach()
        task.act(self, actions)
        outcome = task.outcome(self, self._before, actions)
        observations = task.observations(self)
        self._before = task.place(self).clone()
        state = torch.cat([self.qpos, self.qvel, self.qacc], dim=1)
        # Also true for NaN.
        bounded = (state.abs() <= mujoco.mjMAXVAL).all(dim=1)
        diverged = ~(bounded & observations.isfinite().all(dim=1))
        observations = observations.masked_fill(~observations.isfinite(), 0.0)
        self._clear(diverged)
        poses = self.constants["init_qpos"].to(self.qpos.dtype)
        self.qpos.copy_(torch.where(diverged[:, None], poses, self.qpos))
        rewards = outcome.rewards.masked_fill(diverged, 0.0)
        terminated = outcome.terminated | diverged
        return observations, outcome._replace(rewards=rewards, terminated=terminated), diverged

    def start(
        self, mask: Tensor, seeds: Tensor, episodes: Tensor
    ) -> tuple[Tensor, dict[str, Tensor]]:
        """Start an episode in some worlds.

        Args:
            mask: Which worlds, shape (n,).
            seeds: The seed of each world, shape (n,).
            episodes: How many episodes each world has begun, shape (n,).

        Returns:
            Observations, shape (n, size), and infos; only the rows of `mask` are of the start.
        """
        self._clear(mask)
        if self._redraws:
            drawn = uniforms(seeds, episodes, _BODIES, 1)[:, 0] * len(self.bodies)
            self._choose(torch.where(mask, drawn.to(torch.int64), self.chosen))
        self.task.start(self, mask, seeds, episodes)
        return self._started(mask)

    @without_gradients()
    def set_state(self, qpos: Tensor, qvel: Tensor) -> None:
        """Set positions (n, nq) and velocities (n, nv) of all worlds, and clear the rest.

        Fingers have further state: start them with `start`.
        """
        everywhere = torch.ones(self.count, dtype=torch.bool, device=qpos.device)
        self._clear(everywhere)
        self.qpos[:], self.qvel[:] = qpos, qvel
        self._started(everywhere)

    def _started(self, mask: Tensor) -> tuple[Tensor, dict[str, Tensor]]:
        if self.task.start_forces:
            self.forward()
        else:
            self.kinematics()
        self._before = torch.where(mask[:, None], self.task.place(self), self._before)
        return self.task.observations(self), self.task.start_infos(self)

    def _clear(self, mask: Tensor) -> None:
        """Clear velocities, controls, warm starts and forces, as MuJoCo's own reset does."""
        for view in self._cleared:
            view.masked_fill_(mask.view(-1, *[1] * (view.dim() - 1)), 0.0)

    def simulate(self) -> None:
        """Step the physics `frame_skip` times."""
        self._run("simulate", self._simulate)

    def _simulate(self) -> None:
        for _ in range(self.task.frame_skip):
            mjw.step(self._model, self._data)
        if self.task.contact_forces:
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
    """Return the most contacts and rows of constraints where pairs, (k, 2), of geoms can touch."""
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
