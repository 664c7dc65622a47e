"""A finger moves its joints about in an env, and a log is kept."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from shapechanger.embodiments.finger import JOINTS, TENDONS
from shapechanger.envs.finger.babble import FingerBabble
from shapechanger.envs.finger.plant import CONTROL_DT
from shapechanger.errors import FingerError, LayoutError
from shapechanger.identify import FingerLog
from shapechanger.layout import Layout

__all__ = ["record_babble"]


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
