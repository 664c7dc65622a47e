"""Hydrodynamics of a small boat: hull, propellers, rudder, and the boat in a simulation.

Surge u points ahead and sway v to the left; the rate of turn r is counter-clockwise. All are
relative to the water. X and Y are forces, N, and N is the moment about the middle, N·m. Names
follow T. I. Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control, 2nd ed., Wiley 2021.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import mujoco

from shapechanger.bodies.vehicles.model import Outputs, PlanarPose
from shapechanger.bodies.vehicles.parts import DcMotor, MotorDrive, joints_below_chassis, settle

WATER_DENSITY: Final = 1000.0  # kg/m3, fresh


@dataclass(frozen=True, slots=True)
class Hull:
    """Masses, added masses, drag and lift of a hull.

    Attributes:
        mass: Dry mass, kg.
        inertia: Dry moment of inertia about the vertical axis, kg·m2.
        added_surge: Added mass ahead, kg: water that accelerates with the hull.
        added_sway: Added mass to the side, kg.
        added_yaw: Added moment of inertia, kg·m2.
        surge: Linear drag ahead, N·s/m.
        surge_2: Quadratic drag ahead, N·s2/m2.
        sway: Linear drag to the side, N·s/m.
        sway_2: Quadratic drag to the side, N·s2/m2.
        sway_lift: Lift coefficient of the hull as a wing, times speed and sway, N·s2/m2.
        yaw: Linear drag of a turn, N·m·s.
        yaw_2: Quadratic drag of a turn, N·m·s2.
        yaw_lift: Lift moment of the hull as a wing, times speed and rate of turn, N·s2.
    """

    mass: float
    inertia: float
    added_surge: float
    added_sway: float
    added_yaw: float
    surge: float
    surge_2: float
    sway: float
    sway_2: float
    sway_lift: float
    yaw: float
    yaw_2: float
    yaw_lift: float

    def acceleration(
        self, u: float, v: float, r: float, x: float, y: float, n: float
    ) -> tuple[float, float, float]:
        """Rates of change of u, v and r under the forces of propellers and rudder.

        These are the manoeuvring equations in three degrees of freedom (Fossen, chapter 6) with
        the Coriolis terms of different masses along and across.

        Args:
            u: Surge, m/s.
            v: Sway, m/s.
            r: Rate of turn, rad/s.
            x: Force ahead, N.
            y: Force to the left, N.
            n: Moment, N·m.
        """
        along, across = self.mass + self.added_surge, self.mass + self.added_sway
        pace = math.hypot(u, v)
        x += across * v * r - (self.surge + self.surge_2 * abs(u)) * u
        y += -along * u * r - (self.sway + self.sway_2 * abs(v) + self.sway_lift * pace) * v
        n += (along - across) * u * v
        n -= (self.yaw + self.yaw_2 * abs(r) + self.yaw_lift * pace) * r
        return x / along, y / across, n / (self.inertia + self.added_yaw)


@dataclass(frozen=True, slots=True)
class Propeller:
    """A propeller whose thrust and torque are linear in the advance ratio J = V / (n D).

    Attributes:
        diameter: Diameter, m.
        thrust: Thrust coefficient at J = 0.
        thrust_ends: J at which the thrust is 0.
        torque: Torque coefficient at J = 0.
        torque_ends: J at which the torque is 0.
        astern: Share of thrust and torque when turning backwards.
        wake: Speed of the water at the propeller, as a share of the boat's.
        pushes: Share of the thrust that moves the boat; the rest is thrust deduction.
    """

    diameter: float
    thrust: float
    thrust_ends: float
    torque: float
    torque_ends: float
    astern: float
    wake: float
    pushes: float

    def loads(self, n: float, u: float) -> tuple[float, float]:
        """Thrust, N, and torque, N·m.

        Args:
            n: Turns per second; negative is backwards.
            u: Speed of the boat through the water, m/s.
        """
        inflow = self.wake * u / self.diameter
        common = WATER_DENSITY * self.diameter**4 * abs(n) * (self.astern if n < 0.0 else 1.0)
        thrust = common * self.thrust * (n - inflow / self.thrust_ends)
        torque = common * self.diameter * self.torque * (n - inflow / self.torque_ends)
        return thrust, torque

    def wash(self, thrust: float, u: float) -> float:
        """Speed of the water behind the propeller, m/s, by momentum theory.

        Args:
            thrust: Thrust, N.
            u: Speed of the boat through the water, m/s.
        """
        ahead = self.wake * u
        if thrust <= 0.0 or ahead < 0.0:
            return ahead
        disc = math.pi * self.diameter**2 / 4
        far = math.sqrt(ahead * ahead + 2.0 * thrust / (WATER_DENSITY * disc))
        return ahead + _CONTRACTED * (far - ahead)


# Share of its full speed that the wash has reached at the rudder: 0.6 for hulls in H. Yasukawa and
# Y. Yoshimura, Introduction of MMG standard method, J. Mar. Sci. Technol. 20 (2015).
_CONTRACTED: Final = 0.6


@dataclass(frozen=True, slots=True)
class Fin:
    """A rudder or a skeg: a vertical plate in the water.

    Attributes:
        x: Position ahead of the middle, m; negative.
        height: Height, m.
        chord: Length along the flow, m.
    """

    x: float
    height: float
    chord: float

    @property
    def lift(self) -> float:
        """Normal force over the sine of the angle and the square of the speed, N·s2/m2.

        The slope 6.13 Λ / (Λ + 2.25) of a plate with the aspect ratio Λ is Fujii's; see Yasukawa
        and Yoshimura (2015).
        """
        aspect = self.height / self.chord
        slope = 6.13 * aspect / (aspect + 2.25)
        return 0.5 * WATER_DENSITY * self.height * self.chord * slope

    def force(self, flow: float, v: float, r: float, angle: float) -> tuple[float, float, float]:
        """Forces X and Y, N, and moment N, N·m.

        Args:
            flow: Speed of the water from ahead, m/s.
            v: Sway, m/s.
            r: Rate of turn, rad/s.
            angle: Angle of the blade, rad, counter-clockwise; a negative one turns the boat left.
        """
        aside = v + self.x * r
        sine, cosine = math.sin(angle), math.cos(angle)
        normal = self.lift * math.hypot(flow, aside) * (flow * sine - aside * cosine)
        across = normal * cosine
        return -normal * sine, across, self.x * across


_TURN: Final = 2.0 * math.pi


@dataclass(frozen=True, slots=True)
class Afloat:
    """Underwater parts of a boat.

    Attributes:
        hull: The hull.
        propellers: Propeller of each part, and its position to the left, m.
        rudder: Rudder behind the part "propeller".
        skeg: Fixed fin.
        full_rudder: Rudder angle at an output of 1, rad.
        motor: Motor of each propeller.
    """

    hull: Hull
    propellers: Mapping[str, tuple[Propeller, float]]
    rudder: Fin
    skeg: Fin
    full_rudder: float
    motor: DcMotor


class Floating:
    """A `BoundVehicle` on water, which moves in the plane only: no heave, roll or pitch.

    The simulated body has the dry mass. The applied force is that mass times the acceleration of
    the manoeuvring equations.

    Args:
        model: Compiled model with the boat.
        data: Its state.
        boat: Underwater parts.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, boat: Afloat) -> None:
        self._model = model
        self._data = data
        self._dt = float(model.opt.timestep)
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
        self._qpos, self._qvel, self._ctrl = data.qpos, data.qvel, data.ctrl
        self._push = data.qfrc_applied
        self._flow = (0.0, 0.0)
        self._log_m = 0.0
        self._logged_s = 0.0
        self._has_rudder = True

    def place(self, x: float, y: float, heading: float) -> None:
        """Put the boat at a pose, at rest in the world."""
        p, v = self._qpos0, self._qvel0
        self._qpos[p : p + 3] = (x, y, heading)
        self._qvel[v : v + 3] = 0.0
        self._log_m = 0.0
        self._logged_s = float(self._data.time)
        settle(self._model, self._data, self._joints)

    def drive(self, outputs: Outputs, battery_v: float) -> None:
        """Apply outputs and the forces of the water."""
        rudder = outputs.get("rudder", 0.0)
        self._has_rudder = "rudder" in outputs or "propeller" in outputs
        if rudder is not None:
            self._ctrl[self._servo] = min(1.0, max(-1.0, rudder)) * self._boat.full_rudder
        for part, _, _, drive, _ in self._shafts:
            drive.set(outputs.get(part, 0.0), battery_v)
        self._float()

    def pose(self) -> PlanarPose:
        """Current pose."""
        x, y, heading = self._qpos[self._qpos0 : self._qpos0 + 3].tolist()
        return PlanarPose(x, y, math.remainder(heading, _TURN))

    def speed(self) -> float:
        """Speed over ground along the heading, m/s."""
        cosine, sine, vx, vy, _ = self._motion()
        return vx * cosine + vy * sine

    def lateral_speed(self) -> float:
        """Speed over ground to the left, m/s."""
        cosine, sine, vx, vy, _ = self._motion()
        return vy * cosine - vx * sine

    def yaw_rate(self) -> float:
        """Rate of turn, rad/s, counter-clockwise seen from above."""
        return float(self._qvel[self._qvel0 + 2])

    def travelled_m(self) -> float:
        """Distance through the water since `place`; astern counts down."""
        return self._log_m

    def current_a(self) -> float:
        """Current of all motors, A."""
        return sum(drive.current_a() for _, _, _, drive, _ in self._shafts)

    def set_current(self, vx: float, vy: float) -> None:
        """Set the flow of the water, m/s.

        Args:
            vx: Along the world's x axis.
            vy: Along its y axis.
        """
        self._flow = (vx, vy)

    def _motion(self) -> tuple[float, float, float, float, float]:
        """Cosine and sine of the heading, speeds along the world's axes, and rate of turn."""
        heading = float(self._qpos[self._qpos0 + 2])
        vx, vy, r = self._qvel[self._qvel0 : self._qvel0 + 3].tolist()
        return math.cos(heading), math.sin(heading), vx, vy, r

    def _float(self) -> None:
        """Apply the forces of the water to the hull and the propellers."""
        boat, hull = self._boat, self._boat.hull
        cosine, sine, vx, vy, r = self._motion()
        wx, wy = vx - self._flow[0], vy - self._flow[1]
        u, v = wx * cosine + wy * sine, wy * cosine - wx * sine
        now_s = float(self._data.time)
        # Whole steps, so that the same drive is as long at any time.
        steps = round((now_s - self._logged_s) / self._dt)
        self._log_m += u * self._dt * steps
        self._logged_s = now_s
        x, y, n = boat.skeg.force(u, v, r, 0.0)
        flow = u
        for part, propeller, beside, drive, dof in self._shafts:
            rate = drive.rate()
            if abs(rate) < 1e-3:  # Stopped: neither thrust nor torque.
                self._push[dof] = 0.0
                continue
            thrust, torque = propeller.loads(rate / _TURN, u)
            self._push[dof] = -torque
            x += propeller.pushes * thrust
            n -= propeller.pushes * thrust * beside
            if part == "propeller":
                flow = _on_rudder(propeller, boat.rudder, thrust, u)
        if self._has_rudder:  # Twin propellers steer without one.
            rx, ry, rn = boat.rudder.force(flow, v, r, float(self._qpos[self._rudder]))
            x, y, n = x + rx, y + ry, n + rn
        du, dv, dr = hull.acceleration(u, v, r, x, y, n)
        # From rates in the turning frame of the boat to the acceleration in the world. A uniform
        # flow adds nothing, because u and v are relative to it.
        along, across = hull.mass * (du - r * v), hull.mass * (dv + r * u)
        i = self._qvel0
        self._push[i] = along * cosine - across * sine
        self._push[i + 1] = along * sine + across * cosine
        self._push[i + 2] = hull.inertia * dr


def _on_rudder(propeller: Propeller, rudder: Fin, thrust: float, u: float) -> float:
    """Speed of the water at the rudder, m/s, part of which is in the propeller's wash.

    Squares of speeds are averaged over the height, because forces are proportional to them.
    """
    if thrust <= 0.0 or u < 0.0:
        return u
    share = min(1.0, propeller.diameter / rudder.height)
    return math.sqrt(share * propeller.wash(thrust, u) ** 2 + (1.0 - share) * u * u)
