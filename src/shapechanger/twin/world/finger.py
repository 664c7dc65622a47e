"""A finger on a rig, as what the tendons of its servos pull at."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.bodies.finger import (
    JOINTS,
    TENDONS,
    FingerParameters,
    build_finger,
    drive_of,
)
from shapechanger.bodies.finger.anatomy import JOINT_RANGE, JOINT_REST
from shapechanger.bodies.finger.model import FINGERTIP
from shapechanger.errors import RobotError
from shapechanger.worlds.world import RESTING_V, Pose, Readings

if TYPE_CHECKING:
    from shapechanger.twin.servos.rig import Rig

__all__ = ["FingerWorld"]

# N/m. Chosen, as for every tendon of a twin: a good millimetre for 25 N.
_CABLE_STIFFNESS: Final = 20e3
# kg. What the end of a cable weighs, so that a step of 1 ms can follow the cable's spring.
_CABLE_KG: Final = 0.010
_MOST_STEP_S: Final = 0.001
# Of the rest posture, how far starts are, rad: as in simulation.
_START_SPREAD: Final = 0.1


class FingerWorld:
    """Bones and joints that servos pull; see `World`, `TendonWorld` and `JointWorld`.

    Motors, spools, gears and their friction are those of the twin's servos; so the friction, the
    mass, the lag and the delay of the drive of the parameters are left out here, and the stretch of
    the tendons is the servos' cables'. The noise of the joints is that of their encoders.

    Args:
        parameters: Of the finger.
        seed: Of the first start.

    Attributes:
        resting_v: As every world has it; nothing here has a battery.
    """

    def __init__(self, parameters: FingerParameters, seed: int) -> None:
        bare = parameters.replace(
            tendon_stiffness=None,
            backlash=0.0,
            tendon_friction=0.0,
            motor_kg=_CABLE_KG,
            command_delay=0.0,
        )
        spec = build_finger(bare, drive_of("tension", bare))
        spec.option.timestep = _MOST_STEP_S
        for actuator in list(spec.actuators):
            spec.delete(actuator)
        self._model: mujoco.MjModel = spec.compile()
        self._data = mujoco.MjData(self._model)
        self._arms = parameters.arms
        self._stiffness = parameters.tendon_stiffness or _CABLE_STIFFNESS
        self._tip = self._data.site_xpos[self._model.site(FINGERTIP).id]
        self._joint_noise = parameters.joint_noise
        self._order = np.arange(len(TENDONS))
        self._rig: Rig | None = None
        self.resting_v = RESTING_V
        self.place(seed)

    @property
    def cable_stiffness(self) -> float:
        """Of the tendons, N/m."""
        return self._stiffness

    def connect(self, tendons: Sequence[str], rig: Rig) -> FingerWorld:
        """Be what these tendons pull at; see `TendonWorld.connect`."""
        if sorted(tendons) != sorted(TENDONS):
            raise RobotError(
                f"A finger has the tendons {', '.join(TENDONS)}; this robot has "
                f"{', '.join(tendons)}."
            )
        self._order = np.array([TENDONS.index(name) for name in tendons])
        self._rig = rig
        return self

    def travels(self) -> Sequence[float]:
        """How far the end of each tendon is towards its spool, m; 0 for the straight finger."""
        return (self._arms @ self._data.qpos)[self._order].tolist()

    def pull(self, tensions_n: Sequence[float], dt_s: float) -> Sequence[float]:
        """Let some time go by under these tensions; see `Load`."""
        tensions = np.empty(len(TENDONS))
        tensions[self._order] = tensions_n
        self._data.qfrc_applied[:] = self._arms.T @ tensions
        if dt_s > 0.0:
            self._model.opt.timestep = dt_s
            mujoco.mj_step(self._model, self._data)
        return self.travels()

    def measured_angle(self, joint: str) -> float:
        """One reading of a joint's angle, rad; see `JointWorld`."""
        if joint not in JOINTS:
            raise RobotError(f"A finger has the joints {', '.join(JOINTS)}, and no {joint}.")
        angle = float(self._data.qpos[JOINTS.index(joint)])
        return angle + self._joint_noise * float(self._noise.standard_normal())

    def lay_out(self, seed: int) -> None:
        """There is nothing around a finger: put it at a start."""
        self.place(seed)

    def truth(self) -> dict[str, float]:
        """Where the fingertip is, m, and the angles, rad."""
        mujoco.mj_kinematics(self._model, self._data)
        tip = {f"fingertip/{axis}": float(x) for axis, x in zip("xyz", self._tip, strict=True)}
        angles = zip(JOINTS, self._data.qpos, strict=True)
        return tip | {f"{name}/angle": float(angle) for name, angle in angles}

    def place(self, seed: int) -> None:
        """Put the finger near its posture at rest, at rest, with all tendons just taut."""
        rng = np.random.default_rng(seed)
        low, high = JOINT_RANGE.T
        posture = JOINT_REST + rng.uniform(-_START_SPREAD, _START_SPREAD, len(JOINTS))
        mujoco.mj_resetData(self._model, self._data)
        # Of its own, so that how often somebody reads does not change where starts are.
        self._noise = np.random.default_rng([seed, 1])
        self._data.qpos[:] = np.clip(posture, low, high)
        mujoco.mj_forward(self._model, self._data)
        if self._rig is not None:
            self._rig.settle()

    def put_back(self) -> None:
        """A finger runs into nothing; put it at a start all the same."""
        self.place(0)

    def advance(self, dt_s: float, outputs: Mapping[str, float | None]) -> None:
        """Nothing: the servos' line moves it, by `pull`."""

    def inputs(self) -> Readings:
        """What sensors could measure now: none of these is on a finger."""
        return Readings(Pose(0.0, 0.0, 0.0), battery_v=self.resting_v)

    def distance_m(self) -> float:
        """Nothing is ahead."""
        return 0.0

    def picture(self) -> NDArray[np.uint8]:
        """Nobody looks at it: black, shape (120, 160, 3)."""
        return np.zeros((120, 160, 3), np.uint8)
