"""Model-based controller of the finger: the upper reference for reaching and tracking."""

from __future__ import annotations

import math
from typing import Any, Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.finger.anatomy import LEAST_TENSION_N, TENDONS
from shapechanger.finger.model import build_finger
from shapechanger.finger.parameters import NOMINAL, FingerParameters
from shapechanger.finger.plant import CONTROL_DT
from shapechanger.finger.postures import angles_for, joint_torque
from shapechanger.finger.tensions import TendonDrive, drive_of, tensions_for_torque
from shapechanger.layout import Layout

# Gain on joint errors, 1/s: most of an error is corrected in two steps.
_GAIN: Final = 25.0
# Largest commanded joint speed, rad/s.
_MOST_SPEED: Final = 12.0
_ENDS: Final = (-np.ones(len(TENDONS)), np.ones(len(TENDONS)))


class FingerOracle:
    """Moves the fingertip to the target in its observation.

    Each step computes the angles for the target at the end of the step (inverse kinematics), the
    speeds that lead there, the torques that they need by the finger's model (inertia, weight,
    passive tissue), the tensions that give these torques with the least co-contraction (bounded
    least squares), and the commands that give those tensions, compensating the motors' lag.

    It uses only observations, so it also drives a finger on a bench; the parameters are assumed.

    Args:
        layout: Layout of the observations.
        actions: What an action commands.
        parameters: Assumed parameters of the finger.
        gain: Gain on joint errors, 1/s; lower for a finger with delayed commands.
    """

    def __init__(
        self,
        layout: Layout,
        actions: str = "impedance",
        parameters: FingerParameters = NOMINAL,
        gain: float = _GAIN,
    ) -> None:
        self._drive: TendonDrive = drive_of(actions, NOMINAL)
        self._gain = gain
        self._arms = parameters.arms
        self._most = np.array(parameters.most_tension)
        # The motion of the bones depends on the tensions only, not on how tendons stretch.
        stiff = parameters.replace(tendon_stiffness=None, backlash=0.0, command_delay=0.0)
        self._model = build_finger(stiff, drive_of("tension", stiff)).compile()
        self._data = mujoco.MjData(self._model)
        # Fraction of a change of tension that a motor completes in one step.
        self._follows = 1.0 - math.exp(-CONTROL_DT / parameters.motor_lag)
        names = layout.names
        # Indices of the parts of an observation that the controller uses.
        self._angles, self._velocities, self._tensions = (
            [i for i, name in enumerate(names) if name.endswith(end)]
            for end in ("/angle", "/velocity", "/tension")
        )
        self._target = [names.index(f"target/{axis}") for axis in "xyz"]
        self._wanted: NDArray[np.float64] | None = None

    def reset(self) -> None:
        """Start another episode."""
        self._wanted = None

    def __call__(self, observation: Any) -> NDArray[np.float32]:
        """Return the action, (7,), for an observation, (n,)."""
        seen = np.asarray(observation, np.float64)
        angles, tensions = seen[self._angles], seen[self._tensions]
        wanted, _ = angles_for(seen[self._target], angles if self._wanted is None else self._wanted)
        self._wanted = wanted
        speed = np.clip(self._gain * (wanted - angles), -_MOST_SPEED, _MOST_SPEED)
        # To have this speed by the end of the step.
        acceleration = (speed - seen[self._velocities]) / CONTROL_DT
        torque = joint_torque(self._model, self._data, angles, speed, acceleration)
        # Lengths change while the command acts, so use those in the middle of the step.
        length = -self._arms @ (angles + 0.5 * CONTROL_DT * speed)
        pulling = -self._arms @ speed
        low, high = (self._drive.tension(end, length, pulling) for end in _ENDS)
        low = np.clip(low, LEAST_TENSION_N, self._most)
        high = np.clip(high, low, self._most)
        given, _ = tensions_for_torque(self._arms, torque, low, high)
        ahead = tensions + (given - tensions) / self._follows
        command = self._drive.command(ahead, length, pulling)
        return np.clip(command, -1.0, 1.0).astype(np.float32)
