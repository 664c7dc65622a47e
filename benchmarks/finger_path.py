"""Command path of a rig: the delay that identification finds, and a chattering policy replayed."""

from __future__ import annotations

import os
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import shapechanger  # noqa: F401 - Registers the ids.
from benchmarks.row import Row
from shapechanger.finger.identify import FingerLog, identify
from shapechanger.finger.identify.log import record_babble
from shapechanger.finger.identify.motion import Window
from shapechanger.finger.identify.result import replay
from shapechanger.finger.parameters import FingerParameters
from shapechanger.finger.plant import CONTROL_DT
from shapechanger.finger.task import POLICIES
from shapechanger.policy import load_policy

_SECONDS = 10.0
# Delay of a command on a twin: exactly one tick of the guard, s.
_DELAY_S = 0.010
_NEAR_S = 0.005
_EPISODES = 5
# Seed of the first episode, far from the seeds of trainings and evaluations.
_FIRST_SEED = 3_000_000
# The first steps are left out, so that the replay starts in motion.
_BEGINS = 10
# Lag of the motors that identification finds if it assumes no command path, s.
_LAG_S = 0.002


def path() -> list[Row]:
    """Identify twins of a rig, and replay commands of the shipped policy in the identified fingers.

    The policy was trained without a command path, and its commands chatter.
    """
    many = int(os.environ.get("FINGERS", "3"))
    delays: list[float] = []
    chatter: list[float] = []
    errors: dict[str, list[float]] = {"with its path": [], "without a path": []}
    for seed in range(many):
        env = gym.make(
            "shapechanger/RemoteFinger-v1",
            twin="real-like",
            finger_seed=seed,
            max_episode_steps=-1,
        )
        babble = record_babble(env, _SECONDS, 100 + seed)
        logs = [_played(env, _FIRST_SEED + i) for i in range(_EPISODES)]
        env.close()  # The identification takes longer than a twin in real time would wait.
        found = identify(babble).parameters
        delays.append(found.command_delay)
        chatter += [float(np.abs(np.diff(log.commands, axis=0)).mean()) for log in logs]
        models = found, found.replace(path=None, command_delay=0.0, motor_lag=_LAG_S)
        for name, model in zip(errors, models, strict=True):
            squares = [(_replayed(log, model) - log.angles[_BEGINS:]) ** 2 for log in logs]
            errors[name].append(float(np.degrees(np.sqrt(np.mean(squares)))))
    ms = 1e3 * np.array(delays)
    ratios = np.array(errors["without a path"]) / np.array(errors["with its path"])
    return [
        Row(
            "delay of a rig's twin, found from motion",
            f"{np.mean(ms):.1f} ms",
            f"{', '.join(f'{one:.1f}' for one in ms)} ms on {many} fingers",
            f"10 ms, within {1e3 * _NEAR_S:.0f} ms",
            bool((np.abs(np.array(delays) - _DELAY_S) <= _NEAR_S).all()),
        ),
        *(
            Row(
                f"replay of a chattering policy on a rig's twin, identified finger {name}",
                f"{np.mean(values):.1f} degrees RMS",
                f"{', '.join(f'{one:.1f}' for one in values)} degrees on {many} fingers, "
                f"{2.0 - _BEGINS * CONTROL_DT:.1f} s open loop; commands change by "
                f"{np.mean(chatter):.2f} a step",
                *target,
            )
            for (name, values), target in zip(
                errors.items(),
                (("< 0.7 of that without", bool((ratios > 1.0 / 0.7).all())), ("none", True)),
                strict=True,
            )
        ),
    ]


def _played(env: gym.Env[Any, Any], seed: int) -> FingerLog:
    """Return the log of an episode of the shipped policy, with the true angles."""
    policy = load_policy(POLICIES["reach"])
    observation, info = env.reset(seed=seed)
    seen, angles = [observation], [info["true_angles"]]
    for _ in range(100):
        observation, *_, info = env.step(policy.act(observation[None])[0])
        seen.append(observation)
        angles.append(info["true_angles"])
    unwrapped: Any = env.unwrapped
    places = unwrapped.observation_layout.slices
    rows = np.array(seen)

    def columns(quantity: str) -> NDArray[np.float64]:
        return rows[:, [at.start for name, at in places.items() if name.endswith(f"/{quantity}")]]

    return FingerLog(
        t=np.asarray(CONTROL_DT * np.arange(len(rows)), np.float64),
        commands=columns("command"),
        angles=np.array(angles),
        tensions=columns("tension"),
        lengths=columns("length"),
        actions="impedance",
        control_dt=CONTROL_DT,
    )


def _replayed(log: FingerLog, finger: FingerParameters) -> NDArray[np.float64]:
    """Return the angles of a finger under the commands of a log from `_BEGINS` on, rad, (n, 4)."""
    speeds = np.gradient(log.angles, CONTROL_DT, axis=0)
    window = Window(
        start=float(log.t[_BEGINS]),
        angles=log.angles[_BEGINS:],
        velocities=np.asarray(speeds[_BEGINS], np.float64),
        activations=log.commands[_BEGINS],
    )
    return replay(log, finger, window)
