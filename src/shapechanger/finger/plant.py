"""Simulation of a finger with its sensors, with or without the command path of a rig."""

from __future__ import annotations

import math
from typing import Any, Final, cast

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import FingerError
from shapechanger.finger.anatomy import JOINTS, TENDONS
from shapechanger.finger.model import FINGERTIP, TARGET, build_finger
from shapechanger.finger.parameters import CommandPath, FingerParameters
from shapechanger.finger.task import FingerSenses, fingertip
from shapechanger.finger.tensions import TendonDrive

CONTROL_DT: Final = 0.020
"""Duration of one action, s."""
# Time constant of the smoothing of velocities, s: two control periods.
_LAG_S: Final = 0.040


class JointVelocities:
    """Estimates joint velocities from angles, measured once per `CONTROL_DT`, by differences."""

    def __init__(self) -> None:
        self._angles: NDArray[np.float64] | None = None
        self._velocities = np.zeros(0)

    def forget(self) -> None:
        """Forget all measurements; after the next one, velocities are 0."""
        self._angles = None

    def of(self, angles: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the velocities, rad/s, after new angles, rad, of the same shape."""
        if self._angles is None:
            self._velocities = np.zeros_like(angles)
        else:
            self._velocities = smoothed(self._velocities, self._angles, angles)
        self._angles = angles.copy()
        return self._velocities


def smoothed(velocities: Any, former: Any, angles: Any) -> Any:
    """Return smoothed velocities, rad/s, after new angles, rad; arrays or tensors of any shape."""
    speed = (angles - former) / CONTROL_DT
    return velocities + (1.0 - math.exp(-CONTROL_DT / _LAG_S)) * (speed - velocities)


_N_JOINTS: Final = len(JOINTS)
_N_TENDONS: Final = len(TENDONS)


class FingerPlant:
    """MuJoCo simulation of a finger with its drive and its sensors.

    A command of the drive lasts `CONTROL_DT`. `held` simulates the command path, or is None if the
    parameters have no path.
    """

    def __init__(self, parameters: FingerParameters, drive: TendonDrive) -> None:
        self.parameters = parameters
        self.model: mujoco.MjModel = build_finger(parameters, drive).compile()
        self.data = mujoco.MjData(self.model)
        # A view of all counters, because reading the warnings one by one takes longer than a step.
        self._warnings: NDArray[np.int32] = cast("Any", self.data.warning).number
        self._drive = drive
        timestep = self.model.opt.timestep
        self._frame_skip = round(CONTROL_DT / timestep)
        self.held: HeldTensions | None = None
        if parameters.path is not None:
            self.held = HeldTensions(parameters.path, parameters, drive, CONTROL_DT, timestep)
        self._arms = parameters.arms
        self._tip = self.data.site_xpos[self.model.site(FINGERTIP).id]
        self._command = np.zeros(_N_TENDONS)
        self._differences = JointVelocities()

    @property
    def fingertip(self) -> NDArray[np.float64]:
        """True position of the fingertip, m, (3,)."""
        return self._tip.copy()

    @property
    def angles(self) -> NDArray[np.float64]:
        """True joint angles, rad, (4,)."""
        return self.data.qpos[:_N_JOINTS].copy()

    @property
    def diverged(self) -> bool:
        """Return whether the state was huge or not finite at any time since the last `place`."""
        return bool(self._warnings.any())

    def mark(self, place: NDArray[np.float64]) -> None:
        """Show the target of the fingertip, m, (3,), in rendered frames."""
        self.data.mocap_pos[self.model.body(TARGET).mocapid[0]] = place

    def place(self, angles: NDArray[np.float64], rng: np.random.Generator) -> FingerSenses:
        """Start at rest with these angles, rad, (4,), and every tendon just taut.

        `rng` makes the noise of the measurements.
        """
        model, data = self.model, self.data
        mujoco.mj_resetData(model, data)
        data.qpos[:_N_JOINTS] = angles
        least = self.parameters.least_tension
        if self.parameters.gives:
            data.qpos[_N_JOINTS:] = self._arms @ angles + self.parameters.taut
        taut = np.full(_N_TENDONS, least)
        command = self._drive.command(taut, -self._arms @ angles, np.zeros(_N_TENDONS))
        self._command = np.clip(command, -1.0, 1.0)
        controls = self._command if self.held is None else self.held.start(taut)
        hold_controls(model, data, controls)
        mujoco.mj_forward(model, data)
        self._differences.forget()
        return self._senses(rng, started=True)

    def act(self, command: NDArray[np.float64], rng: np.random.Generator) -> FingerSenses:
        """Apply a command, -1 to 1, (7,), for one control period; `rng` makes the noise."""
        self._command = np.clip(np.asarray(command, np.float64), -1.0, 1.0)
        if self.held is None:
            self.data.ctrl[:] = self._command
            mujoco.mj_step(self.model, self.data, self._frame_skip)
        else:
            self.held.advance(self.model, self.data, self._command)
        mujoco.mj_kinematics(self.model, self.data)  # Move the fingertip to the new angles.
        return self._senses(rng)

    def _senses(self, rng: np.random.Generator, *, started: bool = False) -> FingerSenses:
        joint_noise, tension_noise = self.parameters.joint_noise, self.parameters.tension_noise
        angles, velocities = self.angles, self.data.qvel[:_N_JOINTS].copy()
        if joint_noise > 0.0:
            angles = angles + joint_noise * rng.standard_normal(_N_JOINTS)
        if joint_noise > 0.0 or started:
            velocities = self._differences.of(angles)
        tensions = np.abs(self.data.actuator_force)
        if tension_noise > 0.0:
            tensions = np.maximum(tensions + tension_noise * rng.standard_normal(_N_TENDONS), 0.0)
        lengths, _ = motor_lengths(self.parameters.gives, self._arms, self.data)
        return FingerSenses(angles, velocities, tensions, lengths, self._command, fingertip(angles))


def motor_lengths(
    gives: bool, arms: NDArray[np.float64], data: mujoco.MjData
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the tendons' lengths at the motors, m, and their rates, m/s, (7,) each."""
    if gives:  # Winding up by 1 m shortens a tendon by 1 m.
        return -data.qpos[_N_JOINTS:], -data.qvel[_N_JOINTS:]
    return -arms @ data.qpos[:_N_JOINTS], -arms @ data.qvel[:_N_JOINTS]


# Tolerance of a ratio that must be whole.
_WHOLE: Final = 1e-6


class HeldTensions:
    """Simulates a finger with a command path.

    During a command, which lasts `control_dt` seconds, tensions are computed `computations` times.
    After each computation they are sent in `ticks` ticks with a limited slew. A tick lasts `steps`
    simulation steps of `timestep` seconds.
    """

    def __init__(
        self,
        path: CommandPath,
        parameters: FingerParameters,
        drive: TendonDrive,
        control_dt: float,
        timestep: float,
    ) -> None:
        self.computations = round(control_dt * path.control_hz)
        self.steps = round(1.0 / (path.tick_hz * timestep))
        if abs(self.computations - control_dt * path.control_hz) > _WHOLE or not self.computations:
            raise FingerError(
                f"control_hz of a path must be a multiple of {1.0 / control_dt:g}, the commands "
                f"per second, got {path.control_hz:g}."
            )
        if abs(self.steps * path.tick_hz * timestep - 1.0) > _WHOLE:
            raise FingerError(
                f"tick_hz of a path must divide {1.0 / timestep:g}, the simulation steps per "
                f"second, got {path.tick_hz:g}."
            )
        self.ticks = round(path.tick_hz / path.control_hz)
        self._rise, self._fall = slews(path)
        self._step, self._drive = path.tension_step, drive
        self._arms, self._gives = parameters.arms, parameters.gives
        self._least = parameters.least_tension
        self._most = np.array(parameters.most_tension)
        self._now = np.zeros(len(self._most))

    def start(self, tensions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Start with these tensions, N, (7,), and return the controls that hold them, (7,)."""
        self._now = shares(tensions, self._least, self._most)
        return self._controls()

    def advance(
        self, model: mujoco.MjModel, data: mujoco.MjData, command: NDArray[np.float64]
    ) -> None:
        """Simulate one command, -1 to 1, (7,), in a model whose controls are tensions."""
        for _ in range(self.computations):
            length, speed = motor_lengths(self._gives, self._arms, data)
            tensions = self._drive.tension(command, length, speed)
            aim = shares(tensions, self._least, self._most)
            for _ in range(self.ticks):
                self._now = slewed(self._now, aim, self._rise, self._fall)
                data.ctrl[:] = self._controls()
                mujoco.mj_step(model, data, self.steps)

    def _controls(self) -> NDArray[np.float64]:
        share = self._now
        if self._step > 0.0:
            steps = np.floor((self._least + share * (self._most - self._least)) / self._step)
            share = shares(steps * self._step, self._least, self._most)
        return 2.0 * share - 1.0


def hold_controls(
    model: mujoco.MjModel, data: mujoco.MjData, controls: NDArray[np.float64]
) -> None:
    """Set controls, -1 to 1, (7,), as if they had acted long enough to fill delays and lags."""
    data.ctrl[:] = controls
    data.act[:] = controls
    for i, held in enumerate(controls):
        if model.actuator_history[i, 0] > 0:  # A new history holds zeros.
            samples = np.full((model.actuator_history[i, 0], 1), held)
            mujoco.mj_initCtrlHistory(model, data, i, None, samples)


def slewed(now: Any, aim: Any, rise: Any, fall: Any) -> Any:
    """Move arrays or tensors towards `aim` by at most `rise` up and `fall` down."""
    return aim.clip(now - fall, now + rise)


def shares(tensions: Any, least: Any, most: Any) -> Any:
    """Return tensions, N, as shares of their ranges, 0 to 1, (..., 7); arrays or tensors."""
    return ((tensions - least) / (most - least)).clip(0.0, 1.0)


def slews(path: CommandPath) -> tuple[float, float]:
    """Return the largest rise and fall of a tension per tick, as shares of its range."""
    rise, fall = path.slew_per_s or math.inf, path.slew_down_per_s or math.inf
    return rise / path.tick_hz, fall / path.tick_hz
