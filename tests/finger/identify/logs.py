"""Logs for the identification of fingers."""

import dataclasses
from typing import Any

import gymnasium as gym
import numpy as np

import shapechanger  # noqa: F401 - Registers the ids.
from shapechanger.finger.identify import FingerLog
from shapechanger.finger.identify.kinematics import ARMS, Kinematics
from shapechanger.finger.identify.log import record_babble
from shapechanger.finger.parameters import NOMINAL, FingerParameters


def recorded(seconds: float, seed: int = 0, **arguments: Any) -> tuple[FingerLog, FingerParameters]:
    """Return a log of a simulated finger and its true parameters."""
    env = gym.make("shapechanger/Finger-v1", max_episode_steps=-1, **arguments)
    actions = arguments.get("actions", "impedance")
    log = record_babble(env, seconds, seed, actions)
    truth: Any = env.unwrapped
    env.close()
    return log, truth.parameters


def made_up(rows: int = 300) -> FingerLog:
    """Return a log without forces, in which each joint swings at its own rate."""
    t = 0.02 * np.arange(rows, dtype=np.float64)
    angles = np.sin(np.outer(t, [2.0, 3.1, 4.3, 5.7]))
    zeros = np.zeros((rows, 7))
    return FingerLog(t, zeros, angles, zeros, zeros, "impedance", 0.02)


def kinematics(
    compliance: float = 0.0,
    compliance_sd: float = 1e-6,
    noise: float = 1e-6,
    angles: np.ndarray | None = None,
) -> Kinematics:
    """Return kinematics with nominal arms and a standard error of 0.1 mm."""
    angles = np.zeros((1, 4)) if angles is None else angles
    arms, sd = NOMINAL.arms, 1e-4 * ARMS
    return Kinematics(arms, sd, compliance, compliance_sd, np.full(4, noise), angles)


def changed(log: FingerLog, **changes: Any) -> FingerLog:
    return dataclasses.replace(log, **changes)


def swings(t: np.ndarray) -> np.ndarray:
    """Return the true angles of `synthetic` at times `t` in s: rad, shape (n, 4)."""
    phases = np.array([0.0, 1.0, 2.0, 3.0])
    return 0.5 * np.sin(np.outer(t, [2.0, 3.1, 4.3, 5.7]) + phases)


def synthetic(
    arms: np.ndarray, compliance: float, joint_noise: float, length_noise: float, rows: int = 400
) -> FingerLog:
    """Return a log whose lengths follow from the kinematic model.

    `arms` are in m, (7, 4), the compliance in m/N; noises are standard deviations, rad and m.
    """
    rng = np.random.default_rng(7)
    t = 0.02 * np.arange(rows, dtype=np.float64)
    angles = swings(t)
    tensions = 5.0 + 2.0 * np.sin(np.outer(t, np.linspace(6.0, 12.0, 7)))
    zeros = 1e-3 * np.arange(7)
    lengths = zeros - angles @ arms.T - compliance * tensions
    lengths += length_noise * rng.standard_normal(lengths.shape)
    angles = angles + joint_noise * rng.standard_normal(angles.shape)
    return FingerLog(t, np.zeros((rows, 7)), angles, tensions, lengths, "tension", 0.02)
