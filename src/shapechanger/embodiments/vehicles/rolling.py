"""What all vehicles on land share: a body that is free, and wheels that roll."""

from __future__ import annotations

import math
from collections.abc import Mapping

import mujoco

from shapechanger.embodiments.vehicles.drives import MotorDrive, joints_below_chassis, settle
from shapechanger.embodiments.vehicles.model import Outputs
from shapechanger.embodiments.vehicles.motors import Motor
from shapechanger.worlds.world import Pose

__all__ = ["Rolling"]


class Rolling:
    """A vehicle on land, bound to a simulation: a `Vehicle` but for its steering.

    Args:
        model: Model of everything.
        data: State of everything.
        motors: For each part that drives its motor; the actuator is "vehicle/" and the part.
        radius: Of the wheels that the motors drive, m.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        motors: Mapping[str, Motor],
        radius: float,
    ) -> None:
        self._model = model
        self._data = data
        self._radius = radius
        self._drives = tuple(
            (part, MotorDrive(model, data, f"vehicle/{part}", motor))
            for part, motor in motors.items()
        )
        root = model.joint("vehicle/chassis")
        self._qpos0 = int(root.qposadr[0])
        self._qvel0 = int(root.dofadr[0])
        self._qpos = data.qpos
        self._qvel = data.qvel
        self._joints = joints_below_chassis(model)

    def place(self, x: float, y: float, heading: float) -> None:
        """Put it there at rest, its wheels straight."""
        p, v = self._qpos0, self._qvel0
        half = heading / 2
        self._qpos[p : p + 7] = (x, y, 0.0, math.cos(half), 0.0, 0.0, math.sin(half))
        self._qvel[v : v + 6] = 0.0
        settle(self._model, self._data, self._joints)

    def drive(self, outputs: Outputs, battery_v: float) -> None:
        """Set the voltages of the motors."""
        for part, drive in self._drives:
            drive.set(outputs.get(part, 0.0), battery_v)

    def pose(self) -> Pose:
        """Where it is."""
        p = self._qpos0
        x, y = self._qpos[p : p + 2].tolist()
        return Pose(x, y, self._heading())

    def speed(self) -> float:
        """Along its heading, m/s."""
        heading = self._heading()
        vx, vy = self._qvel[self._qvel0 : self._qvel0 + 2].tolist()
        return vx * math.cos(heading) + vy * math.sin(heading)

    def lateral_speed(self) -> float:
        """To its left, m/s."""
        heading = self._heading()
        vx, vy = self._qvel[self._qvel0 : self._qvel0 + 2].tolist()
        return vy * math.cos(heading) - vx * math.sin(heading)

    def yaw_rate(self) -> float:
        """Counter-clockwise seen from above, rad/s."""
        return float(self._qvel[self._qvel0 + 5])

    def travelled_m(self) -> float:
        """What its driven wheels rolled since it was placed, on average."""
        turned = sum(drive.turned() for _, drive in self._drives)
        return self._radius * turned / len(self._drives)

    def current_a(self) -> float:
        """What its motors draw together."""
        return sum(drive.current_a() for _, drive in self._drives)

    def set_current(self, vx: float, vy: float) -> None:
        """Nothing: there is no water."""

    def _heading(self) -> float:
        p = self._qpos0 + 3
        w, x, y, z = self._qpos[p : p + 4].tolist()
        return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
