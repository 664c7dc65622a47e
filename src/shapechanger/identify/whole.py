"""From a log to a finger."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from shapechanger.embodiments.finger import NOMINAL, FingerParameters
from shapechanger.identify.dynamics import fit_dynamics
from shapechanger.identify.enough import require_enough
from shapechanger.identify.estimates import estimates_of, parameters_of, untold_of
from shapechanger.identify.identified import Identified
from shapechanger.identify.kinematics import fit_kinematics
from shapechanger.identify.log import FingerLog
from shapechanger.identify.motors import fit_motors
from shapechanger.identify.replay import HeldOut, replay
from shapechanger.identify.windows import windows

__all__ = ["identify"]

# Of a log, what its motion is fitted to; the rest is for the check.
_FITTED: Final = 0.8


def identify(
    log: FingerLog,
    said: Callable[[str], None] = lambda _: None,
    known: FingerParameters | None = None,
) -> Identified:
    """Find out what a finger is like.

    Arms and stretch come from lengths, angles and tensions of the whole log; motors from commands
    and tensions of the whole log; joints and friction from the motion in its first four fifths, by
    `mujoco.sysid`. The last fifth is simulated with what was found.

    Args:
        log: In which each joint moves through much of its range, under tensions that change; ten
            seconds are good.
        said: Is told what is being done.
        known: A finger whose motors are those of this one, which a log hardly tells of motors with
            gears: what they weigh, how they drag, and how strong they are.

    Raises:
        FingerError: If the log is too short, or a joint hardly moves in it or only along with
            others.
        MissingExtra: If `mujoco.sysid` is not there.
    """
    require_enough(log)
    said("arms and stretch, from lengths")
    kinematics = fit_kinematics(log)
    said("motors, from tensions")
    motors = fit_motors(log, known or NOMINAL)
    said("joints and friction, from motion")
    last = round(_FITTED * len(log))
    dynamics = fit_dynamics(log, kinematics, motors, last, known=known)
    parameters = parameters_of(kinematics, motors, dynamics, known)
    said("the last fifth, simulated")
    rows = len(log) - 1 - last
    dt = log.control_dt
    window = windows(log, kinematics, motors, len(log) + 1, rows * dt, last * dt)[0]
    return Identified(
        parameters=parameters,
        estimates=estimates_of(kinematics, motors, dynamics, len(log), dt),
        untold=untold_of(motors, known),
        held_out=HeldOut(
            t=log.t[last : last + rows + 1] - log.t[0],
            measured=log.angles[last : last + rows + 1],
            identified=replay(log, parameters, window),
            nominal=replay(log, NOMINAL, window),
        ),
        source=log.source,
        seconds=log.seconds,
    )
