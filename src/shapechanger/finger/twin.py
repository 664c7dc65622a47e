"""Simulated finger that the servos of a rig's twin pull by its tendons."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Final

import mujoco
import numpy as np

from shapechanger.contract.world import World
from shapechanger.errors import RobotError
from shapechanger.finger.anatomy import JOINT_RANGE, JOINT_REST, JOINTS, TENDONS
from shapechanger.finger.gap import resolve_gap
from shapechanger.finger.model import FINGERTIP, build_finger
from shapechanger.finger.parameters import NOMINAL, FingerParameters
from shapechanger.finger.postures import START_SPREAD
from shapechanger.finger.tensions import drive_of
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.drivers.servos.simulation import Rig
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.twin.start import Place

# Chosen stiffness of a cable, N/m: a stretch of 1.25 mm at 25 N.
_CABLE_STIFFNESS: Final = 20e3
# Mass of the end of a cable, kg, large enough to simulate the cable with steps of 1 ms.
_CABLE_KG: Final = 0.010
_MAX_STEP_S: Final = 0.001


def rig_place(profile: Profile, gap: str = "", seed: int | None = None) -> Place | None:
    """Return the place of a rig with the tendons of a finger; None for other robots.

    The finger is drawn from the named reality gap, by default with seed 0. Without a gap, it is the
    nominal finger. For another robot with a gap, a `RobotError` is raised.
    """
    tendons = {output.name for output in profile.outputs if output.driver == "bus_servo"}
    if tendons == set(TENDONS):
        rng = np.random.default_rng(seed or 0)
        return finger_place(resolve_gap(gap).draw(rng) if gap else NOMINAL)
    if gap:
        raise RobotError(
            f"--gap must be used with a finger, but {profile.name} has no servos for the tendons "
            f"{', '.join(TENDONS)}."
        )
    return None


def finger_place(parameters: FingerParameters) -> Place:
    """Return a place that `open_finger` opens, with a finger for the rig to pull."""
    return Place(f"{__name__}:{open_finger.__name__}", {"parameters": parameters.to_json()})


def open_finger(
    parts: Collection[str], camera: CameraPlan | None, seed: int, *, parameters: str
) -> FingerWorld:
    """Open the world of a finger with these parameters, JSON; `parts` and `camera` are unused."""
    del parts, camera
    return FingerWorld(FingerParameters.from_json(parameters), seed)


class FingerWorld(World):
    """Bones and joints of a finger, without surroundings; see `World` and `TendonWorld`.

    The twin simulates servos with motors, spools, gears, cables and friction. Friction of tendons,
    mass, lag and delay of motors are therefore not simulated here. Readings of angles have the
    joint noise of the parameters.
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
        spec.option.timestep = _MAX_STEP_S
        for actuator in list(spec.actuators):
            spec.delete(actuator)
        self._model: mujoco.MjModel = spec.compile()
        self._data = mujoco.MjData(self._model)
        self._arms = parameters.arms
        self.cable_stiffness = parameters.tendon_stiffness or _CABLE_STIFFNESS  # N/m
        self._tip = self._data.site_xpos[self._model.site(FINGERTIP).id]
        self._joint_noise = parameters.joint_noise
        self._order = np.arange(len(TENDONS))
        self._rig: Rig | None = None
        self.place(seed)

    def connect(self, tendons: Sequence[str], rig: Rig) -> None:
        """Attach the tendons of a rig; see `TendonWorld.connect`."""
        if sorted(tendons) != sorted(TENDONS):
            raise RobotError(
                f"A finger has the tendons {', '.join(TENDONS)}; this robot has "
                f"{', '.join(tendons)}."
            )
        self._order = np.array([TENDONS.index(name) for name in tendons])
        self._rig = rig

    def travels(self) -> Sequence[float]:
        """Return the travel of each tendon towards its spool from the straight finger, m."""
        return (self._arms @ self._data.qpos)[self._order].tolist()

    def pull(self, tensions_n: Sequence[float], dt_s: float) -> Sequence[float]:
        """Move under these tensions; see `TendonWorld.pull`."""
        tensions = np.empty(len(TENDONS))
        tensions[self._order] = tensions_n
        self._data.qfrc_applied[:] = self._arms.T @ tensions
        if dt_s > 0.0:
            self._model.opt.timestep = dt_s
            mujoco.mj_step(self._model, self._data)
        return self.travels()

    def measured_angle(self, joint: str) -> float:
        """Return one reading of a joint's angle, rad, with the noise of its encoder."""
        if joint not in JOINTS:
            raise RobotError(f"A finger has the joints {', '.join(JOINTS)}, and no {joint}.")
        angle = float(self._data.qpos[JOINTS.index(joint)])
        return angle + self._joint_noise * float(self._noise.standard_normal())

    def advance(self, dt_s: float, outputs: Mapping[str, float | None]) -> None:
        """Do nothing, because the servo bus moves the finger by `pull`."""

    def truth(self) -> dict[str, float]:
        """Return the position of the fingertip, m, and the angles of the joints, rad."""
        mujoco.mj_kinematics(self._model, self._data)
        tip = {f"fingertip/{axis}": float(x) for axis, x in zip("xyz", self._tip, strict=True)}
        angles = zip(JOINTS, self._data.qpos, strict=True)
        return tip | {f"{name}/angle": float(angle) for name, angle in angles}

    def place(self, seed: int) -> None:
        """Place the finger near its rest posture, at rest, with all tendons just taut."""
        rng = np.random.default_rng(seed)
        low, high = JOINT_RANGE.T
        posture = JOINT_REST + rng.uniform(-START_SPREAD, START_SPREAD, len(JOINTS))
        mujoco.mj_resetData(self._model, self._data)
        # The noise has its own generator, so that the number of readings does not change starts.
        self._noise = np.random.default_rng([seed, 1])
        self._data.qpos[:] = np.clip(posture, low, high)
        mujoco.mj_forward(self._model, self._data)
        if self._rig is not None:
            self._rig.settle()
