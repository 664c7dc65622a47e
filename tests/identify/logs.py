"""Logs to identify fingers from."""

from __future__ import annotations

import dataclasses
from typing import Any

import gymnasium as gym
import numpy as np

import shapechanger  # noqa: F401 - Registers the ids.
from shapechanger.bodies.finger import FingerParameters
from shapechanger.envs.finger.identification import record_babble
from shapechanger.identify import FingerLog

__all__ = ["changed", "made_up", "recorded"]


def recorded(seconds: float, seed: int = 0, **arguments: Any) -> tuple[FingerLog, FingerParameters]:
    """A log of a finger, and the truth about it."""
    env = gym.make("shapechanger/Finger-v1", max_episode_steps=-1, **arguments)
    actions = arguments.get("actions", "impedance")
    log = record_babble(env, seconds, seed, actions)
    truth: Any = env.unwrapped
    env.close()
    return log, truth.parameters


def made_up(rows: int = 300) -> FingerLog:
    """A log that no finger made: joints swing each at its own rate, and nothing pulls."""
    t = 0.02 * np.arange(rows)
    angles = np.sin(np.outer(t, [2.0, 3.1, 4.3, 5.7]))
    nothing = np.zeros((rows, 7))
    return FingerLog(t, nothing, angles, nothing, nothing, "impedance", 0.02)


def changed(log: FingerLog, **changes: Any) -> FingerLog:
    """The same log but for these."""
    return dataclasses.replace(log, **changes)
