"""Accuracy and duration of identifying a finger from ten seconds of noisy babble."""

from __future__ import annotations

import math
import os
import time
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import shapechanger  # noqa: F401 - Registers the ids.
from benchmarks.row import Row
from shapechanger.finger.anatomy import JOINTS
from shapechanger.finger.identify import FingerLog, IdentifiedFinger, identify
from shapechanger.finger.identify.log import record_babble
from shapechanger.finger.parameters import FingerParameters

_SECONDS = 10.0
_SMALL_M = 2e-3


def identified() -> list[Row]:
    """Identify fingers of the gap "real-like", with stretch, friction, play and delay."""
    many = int(os.environ.get("FINGERS", "20"))
    errors: list[float] = []
    worst: list[float] = []
    held: list[bool] = []
    widths: list[float] = []
    seconds: list[float] = []
    motion: list[tuple[float, float]] = []
    factors: dict[str, list[float]] = {}
    for seed in range(many):
        log, truth = _recorded(seed)
        began = time.process_time()
        found = identify(log)
        seconds.append(time.process_time() - began)
        arms, ends = truth.arms, found.arm_intervals
        passed = arms != 0.0
        large = np.abs(arms) > _SMALL_M
        off = _off(found.parameters.arms, arms)
        errors += off.tolist()
        worst.append(float(off.max()))
        held += ((ends[..., 0] <= arms) & (arms <= ends[..., 1]))[passed].tolist()
        widths += (0.5 * (ends[..., 1] - ends[..., 0])[large] / np.abs(arms[large])).tolist()
        motion.append(found.held_out.off)
        for name, value in _factors(found, truth).items():
            factors.setdefault(name, []).append(value)
    degrees = np.degrees(motion)
    fives = sum(value < 0.05 for value in worst)
    share = float(np.mean(held))
    return [
        Row(
            "identified arms above 2 mm: largest error",
            f"{max(errors):.1%}",
            f"median {np.median(errors):.2%}; below 5 % in {fives} of {many} fingers",
            "< 5 %, or the intervals hold",
            max(errors) < 0.05 or share >= 0.9,
        ),
        Row(
            "95 % intervals of all 25 arms that hold the truth",
            f"{share:.1%}",
            f"{many} fingers; half a width is {np.median(widths):.1%} of arms above 2 mm in the "
            f"median, {max(widths):.1%} at most",
            ">= 90 %",
            share >= 0.9,
        ),
        Row(
            "held-out angles, identified finger",
            f"{np.median(degrees[:, 0]):.1f} degrees RMS",
            f"nominal finger {np.median(degrees[:, 1]):.1f}; noise of the angles included",
            "none",
            True,
        ),
        *(
            Row(
                f"identified {name}, over the truth",
                f"{math.exp(np.mean(np.log(values))):.2f}",
                f"root mean square of the logarithm {np.sqrt(np.mean(np.log(values) ** 2)):.2f}",
                "none",
                True,
            )
            for name, values in factors.items()
        ),
        Row(
            "identification of 10 s",
            f"{np.median(seconds):.0f} s of one core",
            f"{min(seconds):.0f} to {max(seconds):.0f} s",
            "< 120 s",
            max(seconds) < 120.0,
        ),
    ]


def _recorded(seed: int) -> tuple[FingerLog, FingerParameters]:
    """Return the log of a random finger and its true parameters."""
    env = gym.make(
        "shapechanger/Finger-v1", gap="real-like", finger_seed=seed, max_episode_steps=-1
    )
    log = record_babble(env, _SECONDS, 100 + seed)
    unwrapped: Any = env.unwrapped
    env.close()
    return log, unwrapped.parameters


def _off(found: NDArray[np.float64], arms: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the relative errors of the arms above 2 mm."""
    large = np.abs(arms) > _SMALL_M
    return np.abs(found - arms)[large] / np.abs(arms[large])


def _factors(found: IdentifiedFinger, truth: FingerParameters) -> dict[str, float]:
    """Return the ratios of identified to true values of parameters other than the arms."""
    mine = found.parameters
    over = {
        f"{name} of {joint}": getattr(mine, name)[j] / getattr(truth, name)[j]
        for name in ("joint_stiffness", "joint_damping")
        for j, joint in enumerate(JOINTS)
    }
    for name in ("tendon_friction", "motor_lag", "command_delay"):
        over[name] = getattr(mine, name) / getattr(truth, name)
    return over
