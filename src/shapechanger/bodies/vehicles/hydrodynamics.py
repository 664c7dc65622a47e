"""What water does to a small boat: on its hull, its propellers and its rudder.

Surge u is ahead, sway v to the left, r the rate of turn counter-clockwise, all relative to the
water; forces X, Y in N and the moment N in N·m about the middle. Names as in T. I. Fossen,
Handbook of Marine Craft Hydrodynamics and Motion Control, 2nd edition, Wiley 2021.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import mujoco

from shapechanger.bodies.vehicles.model import Outputs
from shapechanger.bodies.vehicles.parts import DcMotor, MotorDrive, joints_below_chassis, settle
from shapechanger.worlds.world import Pose

__all__ = ["WATER_DENSITY", "Afloat", "Fin", "Floating", "Hull", "Propeller"]

WATER_DENSITY: Final = 1000.0  # kg/m3, fresh


@dataclass(frozen=True, slots=True)
class Hull:
    """A hull that keeps its masses, its drag and what holds it straight.

    Attributes:
        mass: kg.
        inertia: About the upright axis, kg·m2.
        added_surge: Mass of water that it carries along when it speeds up, kg.
        added_sway: The same to the side, kg.
        added_yaw: The same in a turn, kg·m2.
        surge: Linear drag, N·s/m.
        surge_2: Quadratic drag, N·s2/m2.
        sway: Linear, N·s/m.
        sway_2: Quadratic, N·s2/m2.
        sway_lift: Of the hull as a wing, times speed and sway, N·s2/m2.
        yaw: Linear, N·m·s.
        yaw_2: Quadratic, N·m·s2.
        yaw_lift: Of the hull as a wing, times speed and rate of turn, N·s2.
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

        The equations of manoeuvring in three degrees of freedom, Fossen's chapter 6: a body that
        turns feels what its masses, which differ along and across, had ahead and aside.
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
    """A propeller whose thrust and torque fall in straight lines with its advance J = V / (n D).

    Attributes:
        diameter: m.
        thrust: Coefficient at J = 0.
        thrust_ends: J at which it pushes no more.
        torque: Coefficient at J = 0.
        torque_ends: J at which it turns by itself.
        astern: Share of thrust and torque that is left when it turns backwards.
        wake: Speed of the water at it, as a share of the boat's.
        pushes: Share of its thrust that moves the boat; the rest is lost in the water that it
            draws from below the stern.
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
        """Thrust in N and torque in N·m that it takes.

        Args:
            n: Turns a second; negative is backwards.
            u: Of the boat through the water, m/s.
        """
        inflow = self.wake * u / self.diameter
        common = WATER_DENSITY * self.diameter**4 * abs(n) * (self.astern if n < 0.0 else 1.0)
        thrust = common * self.thrust * (n - inflow / self.thrust_ends)
        torque = common * self.diameter * self.torque * (n - inflow / self.torque_ends)
        return thrust, torque

    def wash(self, thrust: float, u: float) -> float:
        """Speed of the water behind it, m/s, by the theory of momentum."""
        ahead = self.wake * u
        if thrust <= 0.0 or ahead < 0.0:
            return ahead
        disc = math.pi * self.diameter**2 / 4
        far = math.sqrt(ahead * ahead + 2.0 * thrust / (WATER_DENSITY * disc))
        return ahead + _CONTRACTED * (far - ahead)


# How much of its full speed the wash has reached at the rudder: 0.6 for hulls in H. Yasukawa and
# Y. Yoshimura, Introduction of MMG standard method, J. Mar. Sci. Technol. 20 (2015).
_CONTRACTED: Final = 0.6


@dataclass(frozen=True, slots=True)
class Fin:
    """A rudder or a skeg: an upright plate in the water.

    Attributes:
        x: Ahead of the middle, m; negative.
        height: m.
        chord: m.
    """

    x: float
    height: float
    chord: float

    @property
    def lift(self) -> float:
        """Force by sine of the angle and square of the speed, N·s2/m2.

        The slope 6.13 Λ / (Λ + 2.25) of a plate with the aspect ratio Λ is Fujii's, see Yasukawa
        and Yoshimura (2015).
        """
        aspect = self.height / self.chord
        slope = 6.13 * aspect / (aspect + 2.25)
        return 0.5 * WATER_DENSITY * self.height * self.chord * slope

    def force(self, flow: float, v: float, r: float, angle: float) -> tuple[float, float, float]:
        """X, Y and N of it.

        Args:
            flow: Of the water from ahead, m/s.
            v: Sway, m/s.
            r: Rate of turn, rad/s.
            angle: Of its blade, rad, counter-clockwise; so negative turns the boat to the left.
        """
        aside = v + self.x * r
        sine, cosine = math.sin(angle), math.cos(angle)
        normal = self.lift * math.hypot(flow, aside) * (flow * sine - aside * cosine)
        across = normal * cosine
        return -normal * sine, across, self.x * across


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
    motor: DcMotor


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
