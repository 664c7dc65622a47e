"""Converts a rig's measurements to those of `Finger-v1`, and tensions to the rig's commands."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import RobotRefused
from shapechanger.finger.anatomy import JOINT_RANGE, JOINTS, LEAST_TENSION_N, MOMENT_ARMS, TENDONS
from shapechanger.finger.plant import CONTROL_DT, JointVelocities
from shapechanger.finger.postures import moving_torque
from shapechanger.finger.task import FingerSenses, fingertip
from shapechanger.finger.tensions import tensions_for_torque
from shapechanger.layout import Layout

# Length error, m, above which lengths fit no posture; a lost turn is 30 mm on a small spool.
_MISFIT_M: Final = 0.012
_COMPLIANCE: Final = 1.0 / 20e3  # Assumed compliance of the cables, m/N, as on a twin.
_ABOVE_REST: Final = 1e-3  # Smallest command of a length, because 0 is the pretension.
_QUANTITIES: Final = ("length", "speed", "tension")


class RigSenses:
    """Reads the state of a rig, and converts tensions to its commands.

    With encoders at the joints, angles are measured, and velocities are smoothed differences over
    one control period, like `FingerPlant`'s with noisy joints. Otherwise angles are fitted to the
    seven lengths by least squares, with corrections for stretch, the nominal moment arms and the
    ranges of the joints, and velocities are computed from the speeds of the tendons. `least` and
    `most` are the tensions at the commands 0 and 1, N, (7,). If the rig `controls_length`, commands
    are lengths, at tensions of at most `most`, and `least` is `LEAST_TENSION_N`.
    """

    def __init__(self, robot: str, action_layout: Layout, state_layout: Layout) -> None:
        actions = {feature.name: feature for feature in action_layout}
        measured = {q: [f"{name}/{q}" for name in TENDONS] for q in _QUANTITIES}
        lacks = [name for name in TENDONS if name not in actions]
        lacks += [name for names in measured.values() for name in names if name not in state_layout]
        if lacks or len(actions) != len(TENDONS):
            raise RobotRefused(
                f"{robot} is not a finger rig, which has the commands {', '.join(TENDONS)} and no "
                "other, and measures the length, speed and tension of each"
                + (f"; it lacks {', '.join(lacks[:3])}." if lacks else ".")
            )
        self._starts = {name: place.start for name, place in state_layout.slices.items()}
        self._order = [TENDONS.index(name) for name in actions]
        self._places = {q: [self._starts[name] for name in measured[q]] for q in _QUANTITIES}
        self.most = np.array([state_layout[f"{name}/tension"].high for name in TENDONS])
        units = {actions[name].gain_unit for name in TENDONS}
        self.controls_length = units == {"m"}
        if not (self.controls_length or units == {"N"}) or not np.isfinite(self.most).all():
            raise RobotRefused(
                f"The profile of {robot} does not define the tension of its commands: each action "
                "must pull a single tendon, with a weight of 1, and all have the same control."
            )
        self._span = np.array([actions[name].gain for name in TENDONS])
        self._longest = np.array([state_layout[f"{name}/length"].high for name in TENDONS])
        self.least = self.most - self._span
        if self.controls_length:
            self.least = np.full(len(TENDONS), LEAST_TENSION_N)
        # Least squares; positive arms shorten the tendons.
        self._angles_of = np.linalg.pinv(-MOMENT_ARMS)
        self._state = np.zeros(state_layout.size)
        # Indices of the encoders; empty unless each joint has an encoder.
        encoders = [f"{name}/angle" for name in JOINTS if f"{name}/angle" in self._starts]
        is_complete = len(encoders) == len(JOINTS)
        self._encoders = [self._starts[name] for name in encoders] if is_complete else []
        self._differences = JointVelocities()

    def forget(self) -> None:
        """Start over at rest, without earlier measurements."""
        self._differences.forget()

    def misfit(self, senses: FingerSenses) -> str:
        """Return why the lengths fit no posture, with the worst tendon, or "" if they fit one.

        Lengths fit no posture if tendons are slack, or if a servo lost power, and so lost turns.
        """
        longer = senses.lengths + _COMPLIANCE * senses.tensions + MOMENT_ARMS @ senses.angles
        worst = int(np.argmax(np.abs(longer)))
        if abs(longer[worst]) <= _MISFIT_M:
            return ""
        return (
            f"The lengths of the tendons fit no posture of a finger; {TENDONS[worst]} is off "
            f"by {1e3 * abs(longer[worst]):.0f} mm. Servos lose count of their turns without "
            "power: find the zeros with `shapechanger robot calibrate --zeros`."
        )

    def length_values(self, lengths: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return the command of a rig that controls lengths, m, (7,), clipped to their range."""
        shares = np.clip((self._longest - lengths) / self._span, _ABOVE_REST, 1.0)
        return shares[self._order].astype(np.float32)

    def values(self, tensions: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return the rig's command for tensions, N, (7,), clipped to their range."""
        kept = np.clip(tensions, self.least, self.most)
        shares = (kept - self.least) / (self.most - self.least)
        return shares[self._order].astype(np.float32)

    def read(
        self, state: NDArray[Any], absent: tuple[str, ...], commands: NDArray[np.float64]
    ) -> FingerSenses:
        """Convert one state of the rig; numbers named in `absent` keep their last value."""
        missing = [self._starts[name] for name in absent if name in self._starts]
        fresh = np.array(state, np.float64)
        fresh[missing] = self._state[missing]
        self._state = fresh
        lengths, speeds, tensions = (self._state[self._places[each]] for each in _QUANTITIES)
        self.speeds: NDArray[np.float64] = speeds
        if self._encoders:
            angles = self._state[self._encoders]
            velocities = self._differences.of(angles)
        else:
            low, high = JOINT_RANGE.T
            angles = np.clip(self._angles_of @ (lengths + _COMPLIANCE * tensions), low, high)
            velocities = self._angles_of @ speeds
        return FingerSenses(angles, velocities, tensions, lengths, commands, fingertip(angles))


# For rigs that control lengths, tuned on a twin: the rate at which the aim corrects the posture,
# 1/s, the limit of the error, rad, and the additional length that keeps tendons taut, m.
_AIM_RATE: Final = 2.0
_MOST_LAG_RAD: Final = 0.2
_TAUT_M: Final = 0.5e-3

# For rigs that control tensions, tuned on a twin with XL330-M077 servos and spools of 10 mm: the
# approach rate, 1/s, the speed limit, rad/s, and the gain of the speed controller, 1/s.
_RATE: Final = 8.0
_MOST_SPEED: Final = 3.0
_GAIN: Final = 30.0
# Mass of rotor and gears at the tendon, kg.
_GEARED_KG: Final = 1.44
# Friction of the gears, N, and the tendon speed below which it is compensated partly, m/s.
_GEAR_FRICTION_N: Final = 0.55
_CREEP_M_PER_S: Final = 0.004
# Integral gain, N·m/rad, for differences in friction and arms, and speed error limit, rad/s.
_MORE_NM: Final = 0.08
_MOST_LAG: Final = 0.8


class StartApproach:
    """Controller that brings the finger of a rig to a posture, rad, (4,)."""

    def __init__(self, posture: NDArray[np.float64], rig: RigSenses) -> None:
        self._posture, self._rig = posture, rig
        self._aim = posture.copy()
        self._held = moving_torque(posture, np.zeros(4), np.zeros(4))
        self._more = np.zeros(4)
        self._inertia = _GEARED_KG * MOMENT_ARMS.T @ MOMENT_ARMS

    def off(self, senses: FingerSenses) -> float:
        """Return the largest joint error, rad."""
        return float(np.abs(senses.angles - self._posture).max())

    def values(self, senses: FingerSenses) -> NDArray[np.float32]:
        """Return the rig's command for the next control period, (7,)."""
        rig, left = self._rig, self._posture - senses.angles
        if rig.controls_length:
            low, high = JOINT_RANGE.T
            lag = np.clip(left, -_MOST_LAG_RAD, _MOST_LAG_RAD)
            self._aim = np.clip(self._aim + _AIM_RATE * CONTROL_DT * lag, low - 0.2, high + 0.2)
            return rig.length_values(-MOMENT_ARMS @ self._aim - _TAUT_M)
        speed = np.clip(_RATE * left, -_MOST_SPEED, _MOST_SPEED)
        lag = speed - senses.velocities
        self._more += _MORE_NM * CONTROL_DT * np.clip(lag, -_MOST_LAG, _MOST_LAG)
        torque = self._held + self._inertia @ (_GAIN * lag) + self._more
        # Gear friction acts in both directions, so the tensions keep a margin at both limits.
        least, most = rig.least + _GEAR_FRICTION_N, rig.most - _GEAR_FRICTION_N
        pull, _ = tensions_for_torque(MOMENT_ARMS, torque, least, most)
        creep = np.tanh(MOMENT_ARMS @ speed / _CREEP_M_PER_S)
        return rig.values(pull + _GEAR_FRICTION_N * creep)
