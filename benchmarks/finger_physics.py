"""Properties of the simulated finger: coupling, co-contraction, and the error of the time step."""

from __future__ import annotations

from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from benchmarks.row import Row
from shapechanger.finger.anatomy import (
    DIP_BAND,
    DIP_BY_PIP,
    JOINT_REST,
    JOINTS,
    MOMENT_ARMS,
)
from shapechanger.finger.gap import GAPS
from shapechanger.finger.model import build_finger
from shapechanger.finger.parameters import NOMINAL, FingerParameters
from shapechanger.finger.tensions import co_contraction, drive_of

_COMMANDS: Final = 100
_N: Final = len(JOINTS)


def physics() -> list[Row]:
    """Measure the coupling of the end joint, the stiffness, and the error of the time step."""
    off = np.degrees([_end_off(seed) for seed in range(_COMMANDS)])
    beyond = float(np.mean(off > np.degrees(DIP_BAND)))
    low, high = (_stiffness(level) for level in (1.0, 2.5))
    ratios = high / low
    return [
        Row(
            "end joint after 2 s of a random constant command, off 0.6 times the middle one",
            f"{np.median(off):.1f} degrees in the median",
            f"{off.max():.1f} at most; {beyond:.0%} beyond the band of 8 degrees",
            "< 20 degrees",
            float(off.max()) < 20.0,
        ),
        Row(
            "active stiffness of the joints, from 1 to 2.5 times the least co-contraction",
            f"{ratios.min():.2f} to {ratios.max():.2f} times",
            f"{', '.join(f'{value:.3f}' for value in high)} N·m/rad at the higher one",
            "> 1.5",
            float(ratios.min()) > 1.5,
        ),
        *(
            Row(
                f"{name}: angles with half the time step, 1 s of random commands",
                f"{error:.2f} degrees RMS",
                f"time step {1e3 * step:g} ms",
                "< 0.5 degrees",
                error < 0.5,
            )
            for name, (error, step) in {
                "nominal finger": _step_error(NOMINAL),
                "finger of the gap real-like": _step_error(
                    GAPS["real-like"].draw(np.random.default_rng(0)).replace(path=None)
                ),
            }.items()
        ),
    ]


def _end_off(seed: int) -> float:
    """Return how far the end joint is from `DIP_BY_PIP` times the middle one, after 2 s, rad."""
    model = build_finger(NOMINAL, drive_of("impedance", NOMINAL)).compile()
    data = mujoco.MjData(model)
    data.qpos[:] = JOINT_REST
    data.ctrl[:] = np.random.default_rng(seed).uniform(-1.0, 1.0, len(MOMENT_ARMS))
    mujoco.mj_step(model, data, round(2.0 / model.opt.timestep))
    return abs(float(data.qpos[3] - DIP_BY_PIP * data.qpos[2]))


def _stiffness(level: float) -> NDArray[np.float64]:
    """Return the active stiffness of each joint at rest, N·m/rad, (4,).

    Args:
        level: Multiple of the smallest tensions, at least 1 N each, that produce no torque.
    """
    drive = drive_of("impedance", NOMINAL)
    model = build_finger(NOMINAL, drive).compile()
    data = mujoco.MjData(model)
    tensions = level * np.asarray(co_contraction(MOMENT_ARMS))
    command = drive.command(tensions, -MOMENT_ARMS @ JOINT_REST, np.zeros(len(MOMENT_ARMS)))
    data.act[:] = command
    stiffness = np.empty(_N)
    for j in range(_N):
        torques: list[float] = []
        for side in (-0.01, 0.01):
            data.qpos[:] = JOINT_REST
            data.qpos[j] += side
            mujoco.mj_forward(model, data)
            torques.append(float(data.qfrc_actuator[j]))
        stiffness[j] = (torques[0] - torques[1]) / 0.02
    return stiffness


def _step_error(parameters: FingerParameters) -> tuple[float, float]:
    """Return the change of the angles with half the time step, degrees RMS, and the step, s."""
    rng = np.random.default_rng(0)
    commands = rng.uniform(-1.0, 1.0, (20, 50, len(MOMENT_ARMS)))
    model = build_finger(parameters, drive_of("impedance", NOMINAL)).compile()
    step = float(model.opt.timestep)
    found: list[NDArray[np.float64]] = []
    for part in (1, 2):
        model.opt.timestep = step / part
        angles: list[NDArray[np.float64]] = []
        for episode in commands:
            data = mujoco.MjData(model)
            data.qpos[:_N] = JOINT_REST
            if parameters.gives:
                data.qpos[_N:] = parameters.arms @ JOINT_REST + parameters.backlash
            for command in episode:
                data.ctrl[:] = command
                mujoco.mj_step(model, data, round(0.02 / model.opt.timestep))
                angles.append(data.qpos[:_N].copy())
        found.append(np.array(angles))
    return float(np.degrees(np.sqrt(np.mean((found[0] - found[1]) ** 2)))), step
