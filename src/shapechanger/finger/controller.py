"""Controllers of the finger: one reaches the target, one moves for identification."""

from __future__ import annotations

import math
from typing import Any, Final

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from shapechanger.finger.anatomy import (
    DIP_BY_PIP,
    JOINT_RANGE,
    JOINTS,
    LEAST_TENSION_N,
    MOMENT_ARMS,
    MOST_TENSION_N,
    TENDONS,
)
from shapechanger.finger.model import build_finger
from shapechanger.finger.parameters import NOMINAL, FingerParameters
from shapechanger.finger.plant import CONTROL_DT
from shapechanger.finger.postures import angles_for, joint_torque, moving_torque
from shapechanger.finger.tensions import TendonDrive, drive_of, tensions_for_torque
from shapechanger.layout import Layout

# Gain on joint errors, 1/s: most of an error is corrected in two steps.
_GAIN: Final = 25.0
# Largest commanded joint speed, rad/s.
_MOST_SPEED: Final = 12.0
_ENDS: Final = (-np.ones(len(TENDONS)), np.ones(len(TENDONS)))


class FingerController:
    """Moves the fingertip to the target in the observation; policies are compared with it.

    Each step computes the angles for the target (inverse kinematics), the speeds that lead there,
    and the torques for these speeds by the finger's model (inertia, weight, passive tissue). Then
    it computes the tensions for the torques with the least co-contraction (bounded least squares),
    and the commands for the tensions, which compensate the motors' lag.

    The controller uses only observations and assumed parameters, so it also works on a rig.

    Args:
        layout: Layout of the observations.
        actions: Meaning of an action.
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
        # Indices of the parts of an observation that the controller uses.
        self._angles = places_of(layout, JOINTS, "angle")
        self._velocities = places_of(layout, JOINTS, "velocity")
        self._tensions = places_of(layout, TENDONS, "tension")
        self._target = [layout.names.index(f"target/{axis}") for axis in "xyz"]
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
        # The finger reaches `speed` by the end of the step.
        acceleration = (speed - seen[self._velocities]) / CONTROL_DT
        torque = joint_torque(self._model, self._data, angles, speed, acceleration)
        # Lengths change while the command acts, so use the lengths in the middle of the step.
        length = -self._arms @ (angles + 0.5 * CONTROL_DT * speed)
        pulling = -self._arms @ speed
        low, high = (self._drive.tension(end, length, pulling) for end in _ENDS)
        low = np.clip(low, LEAST_TENSION_N, self._most)
        high = np.clip(high, low, self._most)
        given, _ = tensions_for_torque(self._arms, torque, low, high)
        ahead = tensions + (given - tensions) / self._follows
        command = self._drive.command(ahead, length, pulling)
        return np.clip(command, -1.0, 1.0).astype(np.float32)


# Frequencies of the motions, Hz. Ten seconds contain 1.5 to 9 periods; delay and lag would blur
# faster motions.
_SLOWEST_HZ, _FASTEST_HZ = 0.15, 0.9
_WAVES: Final = 4
# With a spread above 1, signals are more often near the ends of a range than in its middle. Moment
# arms have the largest effect near the ends.
_SPREAD: Final = 1.5
# Distance of the commanded posture from each end of a joint's range, as a share of the range.
_MARGIN: Final = 0.05
# Largest commanded distance of the end joint from its coupled angle, rad: beyond `DIP_BAND`, but
# within the strength of the tendons.
_DIP_OFF: Final = math.radians(20.0)
# Range of the lowest tension, which varies over time, N. Slack tendons would not reveal the moment
# arms, and constant tensions would not reveal the stretch.
_LEAST_N: Final = (2.0, 4.5)
# Time constant of the correction of joint errors, s: with a delay, a shorter one would oscillate.
_BACK_S: Final = 0.25
# Limit of the corrected joint error, rad, for example if a joint is stuck at its limit.
_MOST_OFF: Final = 0.4


class FingerBabble:
    """Controller that moves the joints along smooth random motions.

    Three joints move independently; the end joint stays near its coupled angle. The controller
    assumes the nominal finger, and steers the measured angles, `JOINT/angle`, to the wanted ones.
    The lowest tensions vary. An action, whose meaning is `actions`, lasts `control_dt` seconds.
    """

    def __init__(
        self,
        layout: Layout,
        actions: str = "impedance",
        seed: int = 0,
        control_dt: float = CONTROL_DT,
    ) -> None:
        self._angles = places_of(layout, JOINTS, "angle")
        self._drive = drive_of(actions, NOMINAL)
        rng = np.random.default_rng(seed)
        # Each part of the frequency range has one wave, so that every signal has fast waves.
        edges = np.geomspace(_SLOWEST_HZ, _FASTEST_HZ, _WAVES + 1)
        self._joints, self._tendons = (
            (rng.uniform(edges[:-1], edges[1:], shape), rng.uniform(0.0, 2.0 * np.pi, shape))
            for shape in ((len(JOINTS), _WAVES), (len(TENDONS), _WAVES))
        )
        self._back = np.array(NOMINAL.joint_damping) / _BACK_S
        self._dt = control_dt
        self._steps = 0

    def __call__(self, observation: Any) -> NDArray[np.float32]:
        """Return the action, (7,), for an observation, (n,), and advance by one step."""
        angles = np.asarray(observation, np.float64)[self._angles]
        t, dt = self._steps * self._dt, self._dt
        self._steps += 1
        before, wanted, after = (self.posture(at) for at in (t - dt, t, t + dt))
        speed = (after - before) / (2.0 * dt)
        off = np.clip(wanted - angles, -_MOST_OFF, _MOST_OFF)
        torque = moving_torque(wanted, speed, np.zeros(len(JOINTS))) + self._back * off
        least = _LEAST_N[0] + (_LEAST_N[1] - _LEAST_N[0]) * _signals(self._tendons, t)
        tensions, _ = tensions_for_torque(MOMENT_ARMS, torque, least, MOST_TENSION_N)
        # Drives that resist a change of length also need lengths and their rates.
        command = self._drive.command(tensions, -MOMENT_ARMS @ wanted, -MOMENT_ARMS @ speed)
        return np.clip(command, -1.0, 1.0).astype(np.float32)

    def posture(self, t: float) -> NDArray[np.float64]:
        """Return the commanded posture at a time, s: angles, rad, (4,)."""
        low, high = JOINT_RANGE.T
        inner = _MARGIN * (high - low)
        shares = _signals(self._joints, t)
        angles = low + inner + (high - low - 2.0 * inner) * shares
        angles[3] = DIP_BY_PIP * angles[2] + _DIP_OFF * (2.0 * shares[3] - 1.0)
        return np.clip(angles, low + inner, high - inner)


def _signals(waves: tuple[NDArray[np.float64], NDArray[np.float64]], t: float) -> Any:
    """Return smooth signals at a time, s, that are mostly near 0 or 1: (signals,)."""
    hz, phase = waves
    total = np.sin(2.0 * np.pi * hz * t + phase).sum(axis=1)
    # The sum is nearly normal with a variance of one half per wave. With a spread of 1, the normal
    # distribution function would make the values nearly uniform.
    return np.asarray(ndtr(_SPREAD * total / np.sqrt(0.5 * _WAVES)), np.float64)


def places_of(layout: Layout, names: tuple[str, ...], kind: str) -> list[int]:
    """Return the indices of a quantity, such as "angle", of joints or tendons in a layout."""
    slices = layout.slices
    for name in names:
        _ = layout[f"{name}/{kind}"]
    return [slices[f"{name}/{kind}"].start for name in names]
