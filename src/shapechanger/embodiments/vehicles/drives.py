"""Motors and joints of a vehicle in a simulation that runs."""

from __future__ import annotations

import mujoco

from shapechanger.embodiments.vehicles.motors import Motor

__all__ = ["MotorDrive", "joints_below_chassis", "settle"]


class MotorDrive:
    """A motor in the simulation: it turns the mean of some joints, which a tendon takes.

    Args:
        model: Model of everything.
        data: State of everything.
        name: Of the actuator and of the tendon.
        motor: What it is.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, name: str, motor: Motor) -> None:
        self._motor = motor
        self._actuator = int(model.actuator(name).id)
        self._tendon = int(model.tendon(name).id)
        self._ctrl = data.ctrl
        self._velocity = data.ten_velocity
        self._angle = data.ten_length
        self._is_open = False

    def set(self, value: float | None, battery_v: float) -> None:
        """Give it a share of the battery; without a connection it runs along."""
        self._is_open = value is None
        self._ctrl[self._actuator] = (
            self._motor.volts_per_speed * self._velocity[self._tendon]
            if value is None
            else min(1.0, max(-1.0, value)) * battery_v
        )

    def current_a(self) -> float:
        """What it draws, A."""
        if self._is_open:
            return 0.0
        return self._motor.amperes(float(self._ctrl[self._actuator]), self.rate())

    def turned(self) -> float:
        """Angle of its shaft, rad."""
        return float(self._angle[self._tendon])

    def rate(self) -> float:
        """Speed of its shaft, rad/s."""
        return float(self._velocity[self._tendon])


def joints_below_chassis(model: mujoco.MjModel) -> tuple[tuple[int, int], ...]:
    """Place in qpos and in qvel of each joint of the vehicle but those that carry it about."""
    return tuple(
        (int(joint.qposadr[0]), int(joint.dofadr[0]))
        for joint in map(model.joint, range(model.njnt))
        if joint.name.startswith("vehicle/") and not joint.name.startswith("vehicle/chassis")
    )


def settle(model: mujoco.MjModel, data: mujoco.MjData, joints: tuple[tuple[int, int], ...]) -> None:
    """Set these joints to 0 at rest, let no motor pull, and work out what follows."""
    for qpos, qvel in joints:
        data.qpos[qpos] = 0.0
        data.qvel[qvel] = 0.0
    data.ctrl[:] = 0.0
    data.qfrc_applied[:] = 0.0
    data.qacc_warmstart[:] = 0.0
    mujoco.mj_forward(model, data)
