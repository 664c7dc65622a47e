"""Fingers and commands shared by tests."""

from collections.abc import Iterator

import mujoco
import numpy as np

from shapechanger.finger import anatomy
from shapechanger.finger.model import build_finger
from shapechanger.finger.parameters import NOMINAL, FingerParameters
from shapechanger.finger.postures import moving_torque
from shapechanger.finger.tensions import drive_of, tensions_for_torque

# A finger with friction, stretch, backlash and delay.
STRETCHED = NOMINAL.replace(
    tendon_stiffness=10e3, tendon_friction=1.0, backlash=0.5e-3, command_delay=0.03
)


def can_hold(angles: np.ndarray) -> bool:
    """Return whether feasible tensions hold the nominal finger at these angles, rad, (4,)."""
    torque = moving_torque(angles, np.zeros(4), np.zeros(4))
    limits = anatomy.LEAST_TENSION_N, anatomy.MOST_TENSION_N
    return tensions_for_torque(anatomy.MOMENT_ARMS, torque, *limits)[1]


def made(
    parameters: FingerParameters = NOMINAL, mode: str = "tension", *, anatomy: bool = False
) -> mujoco.MjModel:
    return build_finger(parameters, drive_of(mode, NOMINAL), anatomy=anatomy).compile()


def at_rest(model: mujoco.MjModel, parameters: FingerParameters = NOMINAL) -> mujoco.MjData:
    """Return a state in the resting posture with taut tendons."""
    data = mujoco.MjData(model)
    data.qpos[:4] = anatomy.JOINT_REST
    if parameters.gives:
        data.qpos[4:] = parameters.arms @ anatomy.JOINT_REST + parameters.backlash
    data.ctrl[:] = data.act[:] = -1.0
    return data


def harsh_commands(rng: np.random.Generator) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the names of extreme motions and their commands, (n, 7), for steps of 20 ms."""
    yield "random", rng.uniform(-1.0, 1.0, (50, 7))
    yield "bang-bang", rng.choice([-1.0, 1.0], (50, 7))
    yield "bang-bang, slower", np.repeat(rng.choice([-1.0, 1.0], (5, 7)), 10, axis=0)
    yield "all on and off", np.where(np.arange(40)[:, None] % 2, 1.0, -1.0) * np.ones(7)
    yield "all on", np.ones((20, 7))
    yield "all off", -np.ones((10, 7))
    for i in range(7):
        alone = -np.ones((15, 7))
        alone[:, i] = 1.0
        yield f"tendon {i} alone", alone
