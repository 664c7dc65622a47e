"""What a finger is like, found out by moving it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import gymnasium as gym
import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from shapechanger.bodies.finger import JOINTS, NOMINAL, TENDONS, build_finger, drive_of
from shapechanger.bodies.finger.anatomy import JOINT_RANGE, MOMENT_ARMS, MOST_TENSION_N
from shapechanger.bodies.finger.tensions import tensions_for_torque
from shapechanger.envs.finger.plant import CONTROL_DT
from shapechanger.envs.finger.postures import joint_torque
from shapechanger.errors import FingerError, LayoutError
from shapechanger.identify import FingerLog
from shapechanger.layout import Layout

if TYPE_CHECKING:
    import gymnasium as gym

    from shapechanger.bodies.finger import FingerParameters

__all__ = ["FingerBabble", "identified", "record_babble"]

_SECONDS: Final = 10.0


def identified(
    env: gym.Env[Any, Any], actions: str, seed: int, known: FingerParameters | None = None
) -> FingerParameters:
    """Let a finger move all its joints for ten seconds, and identify it.

    Args:
        env: Of the finger; without a longest episode.
        actions: What its actions command.
        seed: Of the motions.
        known: A finger whose motors are those of this one; None where nothing is known of them.

    Raises:
        FingerError: If the motions are not enough, or observations are no list of numbers.
        MissingExtra: If `mujoco.sysid` is not there.
    """
    # An optimiser, which an env that only steps does not need.
    from shapechanger.identify import identify

    return identify(record_babble(env, _SECONDS, seed, actions), known=known).parameters


# Hz. Ten seconds hold several turns of each; faster ones would be smeared by delay and lag.
_SLOWEST_HZ, _FASTEST_HZ = 0.15, 0.9
_WAVES: Final = 4
# More than 1, so that the ends of a range are met more often than its middle: what a joint's arms
# are shows where it is far from there.
_SPREAD: Final = 1.5
# Of its range, how far from either end a joint is led; it may be carried farther.
_MARGIN: Final = 0.05
# N. What each tendon is pulled with at least, which varies with the time: a tendon that hangs slack
# tells nothing about its arms, and one whose tension never changes nothing about how it gives.
_LEAST_N: Final = (2.0, 4.5)
# s. A joint that is off is brought back so slowly that even a late command does not make it swing.
_BACK_S: Final = 0.25
# rad. A joint that hangs on its limit is not pulled back harder than this.
_MOST_OFF: Final = 0.4


class FingerBabble:
    """Leads the joints along smooth random motions, each on its own, under changing tension.

    It takes the finger for the nominal one and makes up for what it is not by the angles that it
    sees. What it needs is in the layout, so that it moves a finger on a bench as well.

    Args:
        layout: Of the observations, with a feature `JOINT/angle` for each joint.
        actions: What an action commands.
        seed: Of the motions.
        control_dt: How long an action acts, s.

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
        for name in JOINTS:
            _ = layout[f"{name}/angle"]
        places = layout.slices
        self._angles = [places[f"{name}/angle"].start for name in JOINTS]
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
        """The action, (7,), for an observation, (n,); each call is a step later."""
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
        # Where the drive resists a change of length, lengths lead the joints as well.
        command = self._drive.command(tensions, -MOMENT_ARMS @ wanted, -MOMENT_ARMS @ speed)
        return np.clip(command, -1.0, 1.0).astype(np.float32)

    def posture(self, t: float) -> NDArray[np.float64]:
        """Where the joints are led to at a time, s: angles, rad, (4,)."""
        low, high = JOINT_RANGE.T
        inner = _MARGIN * (high - low)
        return low + inner + (high - low - 2.0 * inner) * self._joints.at(t)


class _Waves:
    """Several smooth random signals, most often near either end."""

    def __init__(self, rng: np.random.Generator, signals: int) -> None:
        # One wave in each part of the range of frequencies, so that no signal is slow only.
        edges = np.geomspace(_SLOWEST_HZ, _FASTEST_HZ, _WAVES + 1)
        self._hz = rng.uniform(edges[:-1], edges[1:], (signals, _WAVES))
        self._phase = rng.uniform(0.0, 2.0 * np.pi, (signals, _WAVES))

    def at(self, t: float) -> NDArray[np.float64]:
        """The signals, 0 to 1, (signals,)."""
        waves = np.sin(2.0 * np.pi * self._hz * t + self._phase)
        # The sum is nearly normal, of variance one half a wave: its own distribution would make
        # all values as frequent.
        return np.asarray(ndtr(_SPREAD * waves.sum(axis=1) / np.sqrt(0.5 * _WAVES)), np.float64)


def record_babble(
    env: gym.Env[Any, Any], seconds: float, seed: int = 0, actions: str = "impedance"
) -> FingerLog:
    """Let a finger babble for a while.

    Args:
        env: Any env with the layout of a finger, simulated or on a bench, made without a longest
            episode.
        seconds: How long, s.
        seed: Of the motions, and of the env.
        actions: What an action of the env commands.

    Raises:
        LayoutError: If the env does not say what its observations mean.
        UnknownName: If its layout is not that of a finger.
        FingerError: If its observations are no list of numbers, or it ends too early.
    """
    if not isinstance(env.observation_space, gym.spaces.Box):
        raise FingerError("A finger is recorded by a Box observation: leave `goal` out.")
    layout = _layout_of(env)
    control_dt = 1.0 / float(env.metadata.get("render_fps") or 1.0 / CONTROL_DT)
    babble = FingerBabble(layout, actions, seed, control_dt)
    places = {
        kind: _places(layout, names, kind)
        for kind, names in (
            ("angle", JOINTS),
            ("tension", TENDONS),
            ("length", TENDONS),
            ("command", TENDONS),
        )
    }
    observation, _ = env.reset(seed=seed)
    rows: list[NDArray[np.float64]] = [np.array(observation, np.float64)]
    for step in range(round(seconds / control_dt)):
        observation, _, terminated, truncated, info = env.step(babble(observation))
        if terminated or truncated or info.get("diverged"):
            raise FingerError(
                f"The env ended after {(step + 1) * control_dt:.1f} s of {seconds:g} s."
            )
        rows.append(np.array(observation, np.float64))
    seen = np.array(rows)
    return FingerLog(
        t=np.asarray(control_dt * np.arange(len(seen)), np.float64),
        commands=seen[:, places["command"]],
        angles=seen[:, places["angle"]],
        tensions=seen[:, places["tension"]],
        lengths=seen[:, places["length"]],
        actions=actions,
        control_dt=control_dt,
        source=env.spec.id if env.spec else type(env.unwrapped).__name__,
    )


def _layout_of(env: gym.Env[Any, Any]) -> Layout:
    layout = getattr(env.unwrapped, "observation_layout", None)
    if not isinstance(layout, Layout):
        name = env.spec.id if env.spec else type(env.unwrapped).__name__
        raise LayoutError(
            f"{name} publishes no observation_layout, so nothing says what it senses."
        )
    return layout


def _places(layout: Layout, names: tuple[str, ...], kind: str) -> list[int]:
    slices = layout.slices
    for name in names:
        _ = layout[f"{name}/{kind}"]
    return [slices[f"{name}/{kind}"].start for name in names]
