"""A part of a log once more, in simulation: the same commands, the same beginning."""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.embodiments.finger import (
    JOINTS,
    NOMINAL,
    FingerParameters,
    build_finger,
    drive_of,
)
from shapechanger.identify.commands import Commands
from shapechanger.identify.log import FingerLog
from shapechanger.identify.windows import Window

__all__ = ["HeldOut", "replay"]


@dataclass(frozen=True, slots=True)
class HeldOut:
    """What the identified finger and the nominal one make of commands that were not fitted.

    Attributes:
        t: s, (n,), from the beginning of the log.
        measured: Angles, rad, (n, 4).
        identified: Of the identified finger, rad, (n, 4).
        nominal: Of the nominal finger, rad, (n, 4).
    """

    t: NDArray[np.float64]
    measured: NDArray[np.float64]
    identified: NDArray[np.float64]
    nominal: NDArray[np.float64]

    @property
    def off(self) -> tuple[float, float]:
        """Root mean square of what the identified and the nominal finger are off by, rad."""
        found, nominal = (
            float(np.sqrt(np.mean((simulated - self.measured) ** 2)))
            for simulated in (self.identified, self.nominal)
        )
        return found, nominal


def replay(log: FingerLog, parameters: FingerParameters, window: Window) -> NDArray[np.float64]:
    """Angles of a simulated finger, rad, (m + 1, 4), the first of which are the window's.

    Args:
        log: Whose commands it gets.
        parameters: Of the finger.
        window: Where it begins, and for how long it goes on.
    """
    on_time = parameters.replace(command_delay=0.0)  # The commands are late already.
    model = build_finger(on_time, drive_of(log.actions, NOMINAL)).compile()
    skip = math.ceil(log.control_dt / model.opt.timestep - 1e-6)
    step = model.opt.timestep = log.control_dt / skip
    data = mujoco.MjData(model)
    n, arms = len(JOINTS), parameters.arms
    data.qpos[:n], data.qvel[:n] = window.angles[0], window.velocities
    if parameters.tendon_stiffness is not None:
        row = int(np.searchsorted(log.t, window.start - 0.5 * log.control_dt))
        stretch = parameters.backlash + log.tensions[row] / parameters.tendon_stiffness
        data.qpos[n:] = arms @ window.angles[0] + stretch
        data.qvel[n:] = arms @ window.velocities
    commands, delay = Commands(log), parameters.command_delay
    before = math.ceil((window.start - float(log.t[0])) / step)
    data.act[:] = np.clip(
        commands.followed(window.start - before * step, step, before, delay, parameters.motor_lag)[
            -1
        ],
        -1.0,
        1.0,
    )
    periods = len(window.angles) - 1
    late = commands.late(window.start, step, skip * periods, delay)
    angles = [window.angles[0]]
    for period in range(periods):
        for command in late[period * skip : (period + 1) * skip]:
            data.ctrl[:] = command
            mujoco.mj_step(model, data)
        angles.append(data.qpos[:n].copy())
    return np.array(angles)
