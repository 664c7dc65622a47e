"""A boat in a simulation that runs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import mujoco

from shapechanger.embodiments.vehicles.drives import MotorDrive, joints_below_chassis, settle
from shapechanger.embodiments.vehicles.model import Outputs
from shapechanger.embodiments.vehicles.motors import Motor
from shapechanger.embodiments.vehicles.water import Fin, Hull, Propeller
from shapechanger.worlds.world import Pose

__all__ = ["Afloat", "Floating"]

_TURN: Final = 2.0 * math.pi


@dataclass(frozen=True, slots=True)
class Afloat:
    """What of a boat is in the water.

    Attributes:
        hull: The hull.
        propellers: Each part's propeller, and how far to the left it is, m.
        rudder: Behind the part "propeller".
        skeg: The fixed fin that keeps the boat straight.
        full_rudder: Angle at a value of 1, rad.
        motor: Of each propeller.
    """

    hull: Hull
    propellers: Mapping[str, tuple[Propeller, float]]
    rudder: Fin
    skeg: Fin
    full_rudder: float
    motor: Motor


class Floating:
    """A `Vehicle` on water, which moves in the plane only: no heave, roll or pitch.

    The simulation knows the dry hull. So that it moves as the equations of manoeuvring say, it is
    pushed with the dry mass times the acceleration that these give.

    Args:
        model: Model of everything.
        data: State of everything.
        boat: What is in the water.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, boat: Afloat) -> None:
        self._model = model
        self._data = data
        self._boat = boat
        self._shafts = tuple(
            (
                part,
                propeller,
                y,
                MotorDrive(model, data, f"vehicle/{part}", boat.motor),
                int(model.joint(f"vehicle/{part}").dofadr[0]),
            )
            for part, (propeller, y) in boat.propellers.items()
        )
        # Three joints in a row: x, y and yaw.
        self._qpos0 = int(model.joint("vehicle/chassis x").qposadr[0])
        self._qvel0 = int(model.joint("vehicle/chassis x").dofadr[0])
        self._rudder = int(model.joint("vehicle/rudder").qposadr[0])
        self._servo = int(model.actuator("vehicle/rudder").id)
        self._joints = joints_below_chassis(model)
        self._dt = float(model.opt.timestep)
        self._qpos, self._qvel, self._ctrl = data.qpos, data.qvel, data.ctrl
        self._push = data.qfrc_applied
        self._flow = (0.0, 0.0)
        self._log_m = 0.0
        self._has_rudder = True

    def place(self, x: float, y: float, heading: float) -> None:
        """Put it there, at rest in the world."""
        p, v = self._qpos0, self._qvel0
        self._qpos[p : p + 3] = (x, y, heading)
        self._qvel[v : v + 3] = 0.0
        self._log_m = 0.0
        settle(self._model, self._data, self._joints)

    def drive(self, outputs: Outputs, battery_v: float) -> None:
        """Set the motors, and what the water does."""
        rudder = outputs.get("rudder", 0.0)
        self._has_rudder = "rudder" in outputs or "propeller" in outputs
        if rudder is not None:
            self._ctrl[self._servo] = min(1.0, max(-1.0, rudder)) * self._boat.full_rudder
        for part, _, _, drive, _ in self._shafts:
            drive.set(outputs.get(part, 0.0), battery_v)
        self._float()

    def pose(self) -> Pose:
        """Where it is."""
        x, y, heading = self._qpos[self._qpos0 : self._qpos0 + 3].tolist()
        return Pose(x, y, math.remainder(heading, _TURN))

    def speed(self) -> float:
        """Along its heading, over ground, m/s."""
        cosine, sine, vx, vy, _ = self._motion()
        return vx * cosine + vy * sine

    def lateral_speed(self) -> float:
        """To its left, over ground, m/s."""
        cosine, sine, vx, vy, _ = self._motion()
        return vy * cosine - vx * sine

    def yaw_rate(self) -> float:
        """Counter-clockwise seen from above, rad/s."""
        return float(self._qvel[self._qvel0 + 2])

    def travelled_m(self) -> float:
        """How far it went through the water since it was placed, ahead less astern."""
        return self._log_m

    def current_a(self) -> float:
        """What its motors draw together, A."""
        return sum(drive.current_a() for _, _, _, drive, _ in self._shafts)

    def set_current(self, vx: float, vy: float) -> None:
        """Let the water flow so, m/s."""
        self._flow = (vx, vy)

    def _motion(self) -> tuple[float, float, float, float, float]:
        """Cosine and sine of the heading, speeds along the axes of the world, rate of turn."""
        heading = float(self._qpos[self._qpos0 + 2])
        vx, vy, r = self._qvel[self._qvel0 : self._qvel0 + 3].tolist()
        return math.cos(heading), math.sin(heading), vx, vy, r

    def _float(self) -> None:
        """Push the hull and brake the propellers as the water does."""
        boat, hull = self._boat, self._boat.hull
        cosine, sine, vx, vy, r = self._motion()
        wx, wy = vx - self._flow[0], vy - self._flow[1]
        u, v = wx * cosine + wy * sine, wy * cosine - wx * sine
        self._log_m += u * self._dt
        x, y, n = boat.skeg.force(u, v, r, 0.0)
        flow = u
        for part, propeller, beside, drive, dof in self._shafts:
            rate = drive.rate()
            if abs(rate) < 1e-3:  # It stands still: no thrust, no torque.
                self._push[dof] = 0.0
                continue
            thrust, torque = propeller.loads(rate / _TURN, u)
            self._push[dof] = -torque
            x += propeller.pushes * thrust
            n -= propeller.pushes * thrust * beside
            if part == "propeller":
                flow = _on_rudder(propeller, boat.rudder, thrust, u)
        if self._has_rudder:  # A boat that steers by two propellers has none.
            rx, ry, rn = boat.rudder.force(flow, v, r, float(self._qpos[self._rudder]))
            x, y, n = x + rx, y + ry, n + rn
        du, dv, dr = hull.acceleration(u, v, r, x, y, n)
        # From the rates in the boat's frame, which turns, to the acceleration in the world's.
        # Water that flows evenly adds nothing: u and v are relative to it.
        along, across = hull.mass * (du - r * v), hull.mass * (dv + r * u)
        i = self._qvel0
        self._push[i] = along * cosine - across * sine
        self._push[i + 1] = along * sine + across * cosine
        self._push[i + 2] = hull.inertia * dr


def _on_rudder(propeller: Propeller, rudder: Fin, thrust: float, u: float) -> float:
    """Speed of the water at the rudder, m/s: the part behind the propeller gets its wash.

    Squares of speeds are averaged over the height, as forces go with them.
    """
    if thrust <= 0.0 or u < 0.0:
        return u
    share = min(1.0, propeller.diameter / rudder.height)
    return math.sqrt(share * propeller.wash(thrust, u) ** 2 + (1.0 - share) * u * u)
