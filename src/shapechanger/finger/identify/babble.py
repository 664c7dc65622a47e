"""Identify a finger by moving all its joints and recording a log."""

from __future__ import annotations

import math
from typing import Any, Final

import gymnasium as gym
import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from shapechanger.errors import FingerError, LayoutError
from shapechanger.finger.anatomy import (
    DIP_BY_PIP,
    JOINT_RANGE,
    JOINTS,
    MOMENT_ARMS,
    MOST_TENSION_N,
    TENDONS,
)
from shapechanger.finger.identify import FingerLog, identify
from shapechanger.finger.model import build_finger
from shapechanger.finger.parameters import NOMINAL, FingerParameters
from shapechanger.finger.plant import CONTROL_DT
from shapechanger.finger.postures import joint_torque
from shapechanger.finger.tensions import drive_of, tensions_for_torque
from shapechanger.layout import Layout

# Duration of a recording, s.
_SECONDS: Final = 10.0
# Frequencies of the motions, Hz. Ten seconds contain several periods of each; delay and lag would
# blur faster ones.
_SLOWEST_HZ, _FASTEST_HZ = 0.15, 0.9
_WAVES: Final = 4
# Above 1, so that signals are near the ends of a range more often than in its middle: moment arms
# show most where a joint is far from the middle.
_SPREAD: Final = 1.5
# Distance of the commanded posture from either end of a joint's range, as a fraction of it.
_MARGIN: Final = 0.05
# Farthest that the end joint is commanded from where the hood has it, rad: beyond its band, and as
# far as the tendons are strong enough.
_DIP_OFF: Final = math.radians(20.0)
# Range of the lowest tension, which varies over time, N: a slack tendon reveals nothing about its
# arms, and a constant tension nothing about its stretch.
_LEAST_N: Final = (2.0, 4.5)
# Time constant of the correction of joint errors, s: long enough not to oscillate with delay.
_BACK_S: Final = 0.25
# Largest joint error that is corrected, rad, as for a joint that is stuck at its limit.
_MOST_OFF: Final = 0.4


class FingerBabble:
    """Controller that moves the joints along independent smooth random motions.

    It assumes the nominal finger and corrects errors by the measured angles, under tensions that
    vary over time. It finds the angles by the layout, so it also moves a finger on a bench.

    Args:
        layout: Layout of the observations, with a feature `JOINT/angle` for each joint.
        actions: What an action commands.
        seed: Seed of the motions.
        control_dt: Duration of an action, s.

    Raises:
        UnknownName: If the layout lacks an angle, or there is no such mode of action.
    """

    def __init__(
        self,
        layout: Layout,
        actions: str = "impedance",
        seed: int = 0,
        control_dt: float = CONTROL_DT,
    ) -> None:
        self._angles = _places(layout, JOINTS, "angle")
        self._drive = drive_of(actions, NOMINAL)
        rng = np.random.default_rng(seed)
        self._joints = _Waves(rng, len(JOINTS))
        self._tendons = _Waves(rng, len(TENDONS))
        self._model = build_finger(NOMINAL, drive_of("tension", NOMINAL)).compile()
        self._data = mujoco.MjData(self._model)
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
        still = np.zeros(len(JOINTS))
        torque = joint_torque(self._model, self._data, wanted, speed, still) + self._back * off
        least = _LEAST_N[0] + (_LEAST_N[1] - _LEAST_N[0]) * self._tendons.at(t)
        tensions, _ = tensions_for_torque(MOMENT_ARMS, torque, least, MOST_TENSION_N)
        # Drives that resist a change of length need the lengths of the motion too.
        command = self._drive.command(tensions, -MOMENT_ARMS @ wanted, -MOMENT_ARMS @ speed)
        return np.clip(command, -1.0, 1.0).astype(np.float32)

    def posture(self, t: float) -> NDArray[np.float64]:
        """Return the commanded posture at a time, s: angles, rad, (4,)."""
        low, high = JOINT_RANGE.T
        inner = _MARGIN * (high - low)
        shares = self._joints.at(t)
        angles = low + inner + (high - low - 2.0 * inner) * shares
        angles[3] = DIP_BY_PIP * angles[2] + _DIP_OFF * (2.0 * shares[3] - 1.0)
        return np.clip(angles, low + inner, high - inner)


class _Waves:
    """Smooth random signals that are near their ends most of the time."""

    def __init__(self, rng: np.random.Generator, signals: int) -> None:
        # One wave per part of the frequency range, so that no signal has slow waves only.
        edges = np.geomspace(_SLOWEST_HZ, _FASTEST_HZ, _WAVES + 1)
        self._hz = rng.uniform(edges[:-1], edges[1:], (signals, _WAVES))
        self._phase = rng.uniform(0.0, 2.0 * np.pi, (signals, _WAVES))

    def at(self, t: float) -> NDArray[np.float64]:
        """Return the signals at a time, s: 0 to 1, (signals,)."""
        waves = np.sin(2.0 * np.pi * self._hz * t + self._phase)
        # The sum is nearly normal with a variance of one half per wave, so its cumulative
        # distribution makes the values nearly uniform.
        return np.asarray(ndtr(_SPREAD * waves.sum(axis=1) / np.sqrt(0.5 * _WAVES)), np.float64)


def record_babble(
    env: gym.Env[Any, Any], seconds: float, seed: int = 0, actions: str = "impedance"
) -> FingerLog:
    """Record a log of a finger that `FingerBabble` moves.

    Args:
        env: Any env with the layout of a finger, simulated or on a bench, without a time limit.
        seconds: Duration, s.
        seed: Seed of the motions and of the env.
        actions: What an action of the env commands.

    Raises:
        LayoutError: If the env has no `observation_layout`.
        UnknownName: If its layout is not that of a finger.
        FingerError: If its observations are not a vector, or it ends too early.
    """
    if not isinstance(env.observation_space, gym.spaces.Box):
        raise FingerError("Recording a finger needs Box observations: omit `goal`.")
    name = env.spec.id if env.spec else type(env.unwrapped).__name__
    layout = getattr(env.unwrapped, "observation_layout", None)
    if not isinstance(layout, Layout):
        raise LayoutError(
            f"{name} publishes no observation_layout, so its observations have no names."
        )
    control_dt = 1.0 / float(env.metadata.get("render_fps") or 1.0 / CONTROL_DT)
    babble = FingerBabble(layout, actions, seed, control_dt)
    angles = _places(layout, JOINTS, "angle")
    tensions, lengths, commands = (
        _places(layout, TENDONS, kind) for kind in ("tension", "length", "command")
    )
    observation, _ = env.reset(seed=seed)
    rows: list[NDArray[np.float64]] = [np.array(observation, np.float64)]
    for step in range(round(seconds / control_dt)):
        observation, _, terminated, truncated, info = env.step(babble(observation))
        if terminated or truncated or info.get("diverged"):
            because = str(info.get("truncated_because") or "").rstrip(".")
            raise FingerError(
                f"The env ended after {(step + 1) * control_dt:.1f} s of {seconds:g} s"
                + (f": {because}." if because else ".")
            )
        rows.append(np.array(observation, np.float64))
    seen = np.array(rows)
    return FingerLog(
        t=np.asarray(control_dt * np.arange(len(seen)), np.float64),
        commands=seen[:, commands],
        angles=seen[:, angles],
        tensions=seen[:, tensions],
        lengths=seen[:, lengths],
        actions=actions,
        control_dt=control_dt,
        source=name,
        motors=getattr(env.unwrapped, "motors", None),
    )


def _places(layout: Layout, names: tuple[str, ...], kind: str) -> list[int]:
    """Return the indices of a quantity of the joints or tendons; refuse a layout without it."""
    slices = layout.slices
    for name in names:
        _ = layout[f"{name}/{kind}"]
    return [slices[f"{name}/{kind}"].start for name in names]


def identify_env(env: gym.Env[Any, Any], actions: str, seed: int) -> FingerParameters:
    """Move a finger for ten seconds, and identify its parameters.

    Args:
        env: Env of the finger, without a time limit.
        actions: What its actions command.
        seed: Seed of the motions.

    Raises:
        FingerError: If the motions do not suffice, or observations are not a vector.
        MissingExtra: If `mujoco.sysid` is not installed.
    """
    return identify(record_babble(env, _SECONDS, seed, actions)).parameters
