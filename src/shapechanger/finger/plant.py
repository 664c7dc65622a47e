"""The simulated finger: takes commands and returns measurements."""

from __future__ import annotations

import math
from typing import Any, Final, cast

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.finger.anatomy import JOINTS, PHALANX_LENGTH_M, TENDONS
from shapechanger.finger.command_path import HeldTensions, hold_controls
from shapechanger.finger.model import FINGERTIP, TARGET, build_finger
from shapechanger.finger.parameters import FingerParameters
from shapechanger.finger.task import FingerSenses, fingertip
from shapechanger.finger.tensions import TendonDrive

# Time constant of the smoothing of velocities, s: two control periods.
_LAG_S: Final = 0.040


class JointVelocities:
    """Estimates joint velocities from measured angles by smoothed differences.

    Args:
        period_s: Time between two measurements, s.
    """

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._angles: NDArray[np.float64] | None = None
        self._velocities = np.zeros(0)

    def forget(self) -> None:
        """Start over: the next measurement is at rest."""
        self._angles = None

    def of(self, angles: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the velocities, rad/s, after new angles, rad, of the same shape."""
        if self._angles is None:
            self._velocities = np.zeros_like(angles)
        else:
            self._velocities = smoothed(self._velocities, self._angles, angles, self._period_s)
        self._angles = angles.copy()
        return self._velocities


def smoothed(velocities: Any, former: Any, angles: Any, period_s: float) -> Any:
    """Return smoothed velocities after new angles, rad/s, as arrays or tensors of any shape.

    Args:
        velocities: Those of the former angles, rad/s.
        former: The former angles, rad.
        angles: The new angles, rad.
        period_s: Time between them, s.
    """
    speed = (angles - former) / period_s
    return velocities + (1.0 - math.exp(-period_s / _LAG_S)) * (speed - velocities)


CONTROL_DT: Final = 0.020
"""Duration of one action, s."""

_N_JOINTS: Final = len(JOINTS)
_N_TENDONS: Final = len(TENDONS)


class FingerPlant:
    """MuJoCo simulation of a finger with its drive and its sensors.

    Args:
        parameters: Parameters of the finger.
        drive: Meaning of its commands.
        control_dt: Duration of a command, s; a whole number of simulation steps.

    Attributes:
        model: The compiled model.
        data: Its state.
        held: What its commands become on their path; None without one.
    """

    def __init__(self, parameters: FingerParameters, drive: TendonDrive, control_dt: float) -> None:
        self.parameters = parameters
        self.model: mujoco.MjModel = build_finger(parameters, drive).compile()
        self.data = mujoco.MjData(self.model)
        # A view, because reading the warnings one by one takes longer than a step.
        self._warnings: NDArray[np.int32] = cast("Any", self.data.warning).number
        self._drive = drive
        timestep = self.model.opt.timestep
        self._frame_skip = round(control_dt / timestep)
        self.held: HeldTensions | None = None
        if parameters.path is not None:
            self.held = HeldTensions(parameters.path, parameters, drive, control_dt, timestep)
        self._arms = parameters.arms
        self._tip = self.data.site_xpos[self.model.site(FINGERTIP).id]
        self._command = np.zeros(_N_TENDONS)
        self._angles = np.zeros(_N_JOINTS)
        self._velocities = np.zeros(_N_JOINTS)
        self._differences = JointVelocities(control_dt)

    @property
    def fingertip(self) -> NDArray[np.float64]:
        """True place of the fingertip, m, (3,)."""
        return self._tip.copy()

    @property
    def angles(self) -> NDArray[np.float64]:
        """True joint angles, rad, (4,)."""
        return self.data.qpos[:_N_JOINTS].copy()

    @property
    def diverged(self) -> bool:
        """Return whether MuJoCo has found the state huge or not finite since the last `place`."""
        return bool(self._warnings.any())

    def mark(self, place: NDArray[np.float64]) -> None:
        """Show the target of the fingertip, m, (3,), in rendered frames."""
        self.data.mocap_pos[self.model.body(TARGET).mocapid[0]] = place

    def place(self, angles: NDArray[np.float64], rng: np.random.Generator) -> FingerSenses:
        """Start at rest with these angles, rad, (4,), and every tendon just taut.

        Args:
            angles: Joint angles, rad, (4,).
            rng: Source of measurement noise.
        """
        model, data = self.model, self.data
        mujoco.mj_resetData(model, data)
        data.qpos[:_N_JOINTS] = angles
        least = self.parameters.least_tension
        if self.parameters.tendon_stiffness is not None:
            taut = self.parameters.backlash + least / self.parameters.tendon_stiffness
            data.qpos[_N_JOINTS:] = self._arms @ angles + taut
        length = -self._arms @ angles
        command = self._drive.command(np.full(_N_TENDONS, least), length, np.zeros(_N_TENDONS))
        self._command = np.clip(command, -1.0, 1.0)
        controls = self._command
        if self.held is not None:
            controls = self.held.start(np.full(_N_TENDONS, least))
        hold_controls(model, data, controls)
        mujoco.mj_forward(model, data)
        self._angles = self._measured(rng)
        self._differences.forget()
        self._velocities = self._differences.of(self._angles)
        return self._senses(rng)

    def act(self, command: NDArray[np.float64], rng: np.random.Generator) -> FingerSenses:
        """Apply a command for one control period.

        Args:
            command: -1 to 1, (7,).
            rng: Source of measurement noise.
        """
        self._command = np.clip(np.asarray(command, np.float64), -1.0, 1.0)
        if self.held is None:
            self.data.ctrl[:] = self._command
            mujoco.mj_step(self.model, self.data, self._frame_skip)
        else:
            self.held.advance(self.model, self.data, self._command)
        mujoco.mj_kinematics(self.model, self.data)  # Move the fingertip to the new angles.
        self._angles = self._measured(rng)
        if self.parameters.joint_noise > 0.0:
            self._velocities = self._differences.of(self._angles)
        else:
            self._velocities = self.data.qvel[:_N_JOINTS].copy()
        return self._senses(rng)

    def _measured(self, rng: np.random.Generator) -> NDArray[np.float64]:
        noise = self.parameters.joint_noise
        angles = self.angles
        return angles + noise * rng.standard_normal(_N_JOINTS) if noise > 0.0 else angles

    def _senses(self, rng: np.random.Generator) -> FingerSenses:
        tensions = np.abs(self.data.actuator_force)
        noise = self.parameters.tension_noise
        if noise > 0.0:
            tensions = np.maximum(tensions + noise * rng.standard_normal(_N_TENDONS), 0.0)
        return FingerSenses(
            angles=self._angles,
            velocities=self._velocities,
            tensions=tensions,
            # Winding up by 1 m shortens a tendon that gives by 1 m.
            lengths=(
                -self.data.qpos[_N_JOINTS:] if self.parameters.gives else -self._arms @ self.angles
            ),
            commands=self._command,
            fingertip=fingertip(self._angles, PHALANX_LENGTH_M),
        )
