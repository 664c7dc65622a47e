"""Tensions of a rig's servos, which are computed at a rate, held, and sent with a limited slew."""

from __future__ import annotations

import math
from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import FingerError
from shapechanger.finger.anatomy import JOINTS
from shapechanger.finger.parameters import CommandPath, FingerParameters
from shapechanger.finger.tensions import TendonDrive

_N: Final = len(JOINTS)
# Tolerance of a ratio that must be whole.
_WHOLE: Final = 1e-6


class HeldTensions:
    """Simulates a finger whose commands take a path, in place of a drive in each simulation step.

    Args:
        path: The path.
        parameters: Parameters of the finger.
        drive: Meaning of the commands.
        control_dt: Duration of a command, s.
        timestep: Duration of a simulation step, s.

    Attributes:
        computations: How often tensions are computed per command.
        ticks: How often they are sent per computation.
        steps: Simulation steps per tick.

    Raises:
        FingerError: If a command does not last a whole number of computations, or a tick a whole
            number of simulation steps.
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
        self._path, self._drive = path, drive
        self._arms, self._gives = parameters.arms, parameters.gives
        self._least = parameters.least_tension
        self._range = np.array(parameters.most_tension) - self._least
        self._now = np.zeros(len(self._range))

    def start(self, tensions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Start with these tensions, N, (7,), and return the controls that hold them, (7,)."""
        self._now = self._share(tensions)
        return self._controls()

    def advance(
        self, model: mujoco.MjModel, data: mujoco.MjData, command: NDArray[np.float64]
    ) -> None:
        """Simulate one command.

        Args:
            model: Model of the finger, whose controls span the range of tensions.
            data: Its state.
            command: -1 to 1, (7,).
        """
        for _ in range(self.computations):
            if self._gives:  # Winding up by 1 m shortens a tendon by 1 m.
                length, speed = -data.qpos[_N:], -data.qvel[_N:]
            else:
                length, speed = -self._arms @ data.qpos[:_N], -self._arms @ data.qvel[:_N]
            aim = self._share(self._drive.tension(command, length, speed))
            for _ in range(self.ticks):
                self._now = slewed(self._path, self._now, aim)
                data.ctrl[:] = self._controls()
                mujoco.mj_step(model, data, self.steps)

    def _share(self, tensions: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.clip((tensions - self._least) / self._range, 0.0, 1.0)

    def _controls(self) -> NDArray[np.float64]:
        share = self._now
        if self._path.tension_step > 0.0:
            steps = np.floor((self._least + share * self._range) / self._path.tension_step)
            share = self._share(steps * self._path.tension_step)
        return 2.0 * share - 1.0


def hold_controls(
    model: mujoco.MjModel, data: mujoco.MjData, controls: NDArray[np.float64]
) -> None:
    """Set controls that have acted for long, and act until the first delayed ones arrive.

    Args:
        model: Model of a finger.
        data: Its state.
        controls: The controls, -1 to 1, (7,).
    """
    data.ctrl[:] = controls
    data.act[:] = controls
    for i, held in enumerate(controls):
        if model.actuator_history[i, 0] > 0:  # A new history holds zeros.
            samples = np.full((model.actuator_history[i, 0], 1), held)
            mujoco.mj_initCtrlHistory(model, data, i, None, samples)


def slewed(
    path: CommandPath, now: NDArray[np.float64], aim: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the tensions of the next tick, as `shapechanger.robot.guard.limits.slewed` does.

    Args:
        path: The path.
        now: Present tensions, as shares of their ranges, 0 to 1, (n,).
        aim: Tensions asked for, likewise.
    """
    rise, fall = slews(path)
    return np.clip(aim, now - fall, now + rise)


def slews(path: CommandPath) -> tuple[float, float]:
    """Return the largest rise and fall of a tension per tick, as shares of its range."""
    rise, fall = (
        math.inf if slew is None else slew / path.tick_hz
        for slew in (path.slew_per_s, path.slew_down_per_s)
    )
    return rise, fall
