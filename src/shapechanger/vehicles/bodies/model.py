"""Vehicles in a running simulation: land vehicles, the boat, and contacts."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import mujoco
import numpy as np

from shapechanger.vehicles.bodies.parts import DcMotor

Outputs = Mapping[str, float | None]
"""Output of each part, from -1 to 1, or None.

An output of a motor is a share of the battery's voltage; an output of a servo is a share of its
travel, negative to the left. None disconnects a motor, and lets a servo keep its last angle.
"""


class Motion(NamedTuple):
    """Pose of a vehicle seen from above, and its velocity."""

    x: float  # Position, m.
    y: float
    heading: float  # Angle from the x axis, rad, counter-clockwise.
    speed: float  # Speed along the heading, m/s; backward is negative.
    lateral_speed: float  # Speed to the left, m/s.
    yaw_rate: float  # Rate of turn, rad/s, counter-clockwise seen from above.


class BoundVehicle(ABC):
    """A vehicle in a running simulation. Its origin is on the ground below its middle.

    A tendon named "vehicle/" plus a part has a `motor` that drives this part. `full_lock` is the
    angle of the front wheels or the rudder at a steering of 1, rad.
    """

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, motor: DcMotor, full_lock: float
    ) -> None:
        self._model, self._data, self._motor, self._full_lock = model, data, motor, full_lock
        self._qpos, self._qvel, self._ctrl = data.qpos, data.qvel, data.ctrl
        self._rates = data.ten_velocity  # Speeds of the shafts, rad/s.
        # Actuator and tendon of each driven part, and the parts that are disconnected.
        self._shafts = {
            model.tendon(i).name.removeprefix("vehicle/"): (
                int(model.actuator(model.tendon(i).name).id),
                i,
            )
            for i in range(model.ntendon)
        }
        self._open = frozenset[str]()
        self._flow = (0.0, 0.0)
        # Addresses in qpos and qvel of the joints of wheels, rudders and trailers.
        self._joints = [
            (int(joint.qposadr[0]), int(joint.dofadr[0]))
            for joint in map(model.joint, range(model.njnt))
            if joint.name.startswith("vehicle/") and not joint.name.startswith("vehicle/chassis")
        ]

    @abstractmethod
    def _place_chassis(self, x: float, y: float, heading: float) -> None:
        """Set position and velocity of the chassis; see `place`."""

    def place(self, x: float, y: float, heading: float) -> None:
        """Put the vehicle at a pose, m and rad, at rest and with straight wheels."""
        self._place_chassis(x, y, heading)
        for qpos, qvel in self._joints:
            self._qpos[qpos] = 0.0
            self._qvel[qvel] = 0.0
        self._ctrl[:] = 0.0
        self._data.qfrc_applied[:] = 0.0
        self._data.qacc_warmstart[:] = 0.0
        mujoco.mj_forward(self._model, self._data)

    def drive(self, outputs: Outputs, battery_v: float) -> None:
        """Apply the outputs, and the forces of the water to a boat; call this every 10 ms."""
        self._open = frozenset([part for part in self._shafts if outputs.get(part, 0.0) is None])
        for part, (actuator, tendon) in self._shafts.items():
            value = outputs.get(part, 0.0)
            self._ctrl[actuator] = (
                self._motor.volts_per_speed * self._rates[tendon]
                if value is None
                else min(1.0, max(-1.0, value)) * battery_v
            )

    @abstractmethod
    def motion(self) -> Motion:
        """Current pose and velocity."""

    @abstractmethod
    def travelled_m(self) -> float:
        """Distance rolled, or moved through the water by a boat, since `place`, m."""

    def current_a(self) -> float:
        """Current of the motors, A, >= 0; a braking motor draws none."""
        total_a = 0.0
        for part, (actuator, tendon) in self._shafts.items():
            if part not in self._open:
                volts, rate = float(self._ctrl[actuator]), float(self._rates[tendon])
                total_a += self._motor.amperes(volts, rate)
        return total_a

    def set_current(self, vx: float, vy: float) -> None:
        """Set the flow of the water, m/s; land vehicles ignore it, and `place` keeps it."""
        self._flow = (vx, vy)


class Rolling(BoundVehicle):
    """A vehicle on land."""

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, motor: DcMotor, full_lock: float
    ) -> None:
        super().__init__(model, data, motor, full_lock)
        root = model.joint("vehicle/chassis")
        self._qpos0, self._qvel0 = int(root.qposadr[0]), int(root.dofadr[0])
        geoms = map(model.geom, range(model.ngeom))
        self._radius = next(float(geom.size[0]) for geom in geoms if geom.name.endswith(" wheel"))
        self._steering = 0.0
        if full_lock:
            self._servos = [model.actuator(f"vehicle/{n} steering").id for n in ("left", "right")]
            knuckle, rear = map(model.body, ("vehicle/left knuckle", "vehicle/rear left wheel"))
            self._wheelbase = float(knuckle.pos[0] - rear.pos[0])
            self._half_gauge = float(knuckle.pos[1])

    def _place_chassis(self, x: float, y: float, heading: float) -> None:
        self._steering = 0.0
        p, v = self._qpos0, self._qvel0
        half = heading / 2
        self._qpos[p : p + 7] = (x, y, 0.0, math.cos(half), 0.0, 0.0, math.sin(half))
        self._qvel[v : v + 6] = 0.0

    def drive(self, outputs: Outputs, battery_v: float) -> None:
        """Set the voltages of the motors and the angles of the front wheels.

        If it steers, all wheels but a trailer's roll around one point of the rear axle's line
        (Ackermann's condition).
        """
        super().drive(outputs, battery_v)
        steering = outputs.get("steering", 0.0)
        if not self._full_lock or steering is None or steering == self._steering:
            return
        self._steering = steering
        angle = -min(1.0, max(-1.0, steering)) * self._full_lock
        curvature = math.tan(angle) / self._wheelbase
        along, half = self._wheelbase * curvature, curvature * self._half_gauge
        for servo, shorter in zip(self._servos, (half, -half), strict=True):
            self._ctrl[servo] = math.atan(along / (1.0 - shorter))

    def motion(self) -> Motion:
        """Current pose and velocity."""
        p, v = self._qpos0, self._qvel0
        x, y, _, qw, qx, qy, qz = self._qpos[p : p + 7].tolist()
        vx, vy, _, _, _, yaw_rate = self._qvel[v : v + 6].tolist()
        heading = math.atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
        cosine, sine = math.cos(heading), math.sin(heading)
        return Motion(x, y, heading, vx * cosine + vy * sine, vy * cosine - vx * sine, yaw_rate)

    def travelled_m(self) -> float:
        """Mean distance that the driven wheels rolled since `place`, m."""
        # Each tendon measures the angle of one shaft, rad.
        return self._radius * sum(self._data.ten_length.tolist()) / len(self._shafts)


# The boat. Surge u points ahead and sway v to the left, relative to the water; rate of turn r is
# counter-clockwise. X and Y are forces, N, and N is the moment about the middle, N·m. Names follow
# T. I. Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control, 2nd ed., Wiley 2021.
_WATER_DENSITY: Final = 1000.0  # kg/m3, fresh
# Share of the speed that a propeller adds to the water that is reached at the rudder: 0.6 in H.
# Yasukawa, Y. Yoshimura, Introduction of MMG standard method, J. Mar. Sci. Technol. 20 (2015).
_CONTRACTED: Final = 0.6


@dataclass(frozen=True, slots=True)
class Propeller:
    """A propeller whose thrust and torque are linear in the advance ratio J = V / (n D)."""

    diameter: float  # m.
    thrust: float  # Thrust coefficient at J = 0.
    zero_thrust_j: float  # J at which the thrust is 0.
    torque: float  # Torque coefficient at J = 0.
    zero_torque_j: float  # J at which the torque is 0.
    astern: float  # Factor on thrust and torque when turning backwards.
    wake: float  # Speed of the water at the propeller, divided by the speed of the boat.
    thrust_deduction: float  # Share of the thrust that is lost by suction at the hull.

    def loads(self, n: float, u: float) -> tuple[float, float]:
        """Thrust, N, and torque, N·m, at `n` turns/s and a speed `u` through the water, m/s."""
        inflow = self.wake * u / self.diameter
        common = _WATER_DENSITY * self.diameter**4 * abs(n) * (self.astern if n < 0.0 else 1.0)
        thrust = common * self.thrust * (n - inflow / self.zero_thrust_j)
        torque = common * self.diameter * self.torque * (n - inflow / self.zero_torque_j)
        return thrust, torque

    def wash(self, thrust: float, u: float) -> float:
        """Speed of the water at the rudder, m/s, from the thrust, N, by momentum theory."""
        ahead = self.wake * u
        if thrust <= 0.0 or ahead < 0.0:
            return ahead
        disc = math.pi * self.diameter**2 / 4
        far = math.sqrt(ahead * ahead + 2.0 * thrust / (_WATER_DENSITY * disc))
        return ahead + _CONTRACTED * (far - ahead)


@dataclass(frozen=True, slots=True)
class Fin:
    """A rudder or a skeg: a vertical plate in the water."""

    x: float  # Position ahead of the middle, m; negative.
    height: float  # m.
    chord: float  # Length along the flow, m.

    @property
    def lift(self) -> float:
        """Normal force divided by sin(angle of attack) and by the squared speed, N·s2/m2.

        The slope 6.13 Λ / (Λ + 2.25) of a plate with the aspect ratio Λ is Fujii's; see Yasukawa
        and Yoshimura (2015).
        """
        aspect = self.height / self.chord
        slope = 6.13 * aspect / (aspect + 2.25)
        return 0.5 * _WATER_DENSITY * self.height * self.chord * slope

    def force(self, flow: float, v: float, r: float, angle: float) -> tuple[float, float, float]:
        """Forces X and Y, N, and moment N, N·m, in a flow from ahead, m/s.

        `angle` is the angle of the blade, rad, counter-clockwise. A negative angle turns the boat
        left.
        """
        aside = v + self.x * r
        sine, cosine = math.sin(angle), math.cos(angle)
        normal = self.lift * math.hypot(flow, aside) * (flow * sine - aside * cosine)
        across = normal * cosine
        return -normal * sine, across, self.x * across


_LENGTH: Final = 0.60  # m
_WIDTH: Final = 0.20  # m
_DRAUGHT: Final = 0.04  # m
_BLOCK: Final = 0.55  # Block coefficient, usual for workboats.
_MASS: Final = _WATER_DENSITY * _BLOCK * _LENGTH * _WIDTH * _DRAUGHT

# The radius of gyration in yaw is 0.25 lengths, the usual estimate for ships (Fossen, chapter 6).
_INERTIA: Final = _MASS * (0.25 * _LENGTH) ** 2
# Mass and inertia including added mass, the water that accelerates with the hull. The ratios were
# measured for CyberShip II, a model of 1.26 m: R. Skjetne, T. I. Fossen and P. Kokotović, Adaptive
# maneuvering, Automatica 41 (2005), table of parameters.
_ALONG: Final = _MASS + 2.0 / 23.8 * _MASS  # kg
_ACROSS: Final = _MASS + 10.0 / 23.8 * _MASS  # kg
_YAW: Final = _INERTIA + 1.0 / 1.76 * _INERTIA  # kg·m2
# Wetted surface and drag coefficient at a Froude number near 0.5 are estimates. Of the coefficient,
# about 0.005 is friction (ITTC 1957 line) and the rest is wave drag.
_WETTED: Final = 0.8 * _LENGTH * (_WIDTH + 2.0 * _DRAUGHT)  # m2
_SURGE_COEFFICIENT: Final = 0.0135
# Cross-flow drag of a hull with rounded bilges, an estimate after Hoerner in Fossen's chapter 6.
_CROSSFLOW_COEFFICIENT: Final = 0.7
# Quadratic drag ahead and to the side, N·s2/m2, and of a turn, N·m·s2. For a turn about the middle,
# cross-flow drag is integrated along the hull.
_SURGE_2: Final = 0.5 * _WATER_DENSITY * _WETTED * _SURGE_COEFFICIENT
_SWAY_2: Final = 0.5 * _WATER_DENSITY * _CROSSFLOW_COEFFICIENT * _DRAUGHT * _LENGTH
_YAW_2: Final = 0.5 * _WATER_DENSITY * _CROSSFLOW_COEFFICIENT * _DRAUGHT * _LENGTH**4 / 32.0
# Linear terms are estimates: they equal the quadratic ones at 0.1 m/s, and at 0.5 rad/s in yaw.
_SURGE_1: Final = 0.1 * 0.5 * _WATER_DENSITY * _WETTED * _SURGE_COEFFICIENT  # N·s/m
_SWAY_1: Final = 0.1 * 0.5 * _WATER_DENSITY * _CROSSFLOW_COEFFICIENT * _DRAUGHT * _LENGTH  # N·s/m
_YAW_1: Final = 0.5 * _YAW_2  # N·m·s
# A drifting hull acts as a low wing. Its force is `_SWAY_LIFT`, N·s2/m2, times speed and sway; its
# moment is `_YAW_LIFT`, N·s2, times speed and rate of turn. Clarke, Gedling and Hine (1983; in
# Fossen, chapter 6) give Y_v and N_r from length, beam, draught and block coefficient.
_WING: Final = math.pi * (_DRAUGHT / _LENGTH) ** 2
_SWAY_WING: Final = _WING * (1.0 + 0.4 * _BLOCK * _WIDTH / _DRAUGHT)
_YAW_WING: Final = _WING * (0.25 + 0.039 * _WIDTH / _DRAUGHT - 0.56 * _WIDTH / _LENGTH)
_SWAY_LIFT: Final = 0.5 * _WATER_DENSITY * _LENGTH**2 * _SWAY_WING
_YAW_LIFT: Final = 0.5 * _WATER_DENSITY * _LENGTH**4 * _YAW_WING

# Linear fits by eye to the open-water curves of a Wageningen B3-50 propeller with a pitch of 0.9
# diameters (M. Oosterveld and P. van Oossanen 1975). The loss of half astern is an estimate.
_PROPELLER: Final = Propeller(
    diameter=0.035, thrust=0.38, zero_thrust_j=0.95, torque=0.045, zero_torque_j=1.1, astern=0.5,
    wake=0.85, thrust_deduction=0.1,
)  # fmt: skip
_TWIN: Final = replace(_PROPELLER, diameter=0.028, wake=0.9)
_PROPELLERS: Final = {"propeller": _PROPELLER, "left propeller": _TWIN, "right propeller": _TWIN}

_RUDDER: Final = Fin(x=-0.27, height=0.045, chord=0.035)
_SKEG: Final = Fin(x=-0.20, height=0.035, chord=0.10)


class Floating(BoundVehicle):
    """The boat in a simulation. It moves in the plane only: no heave, roll or pitch.

    A robot drives either the central propeller and the rudder, or the twin propellers. Parts that
    it does not drive stay still and have no effect. The simulated body has the dry mass. The
    applied force is that mass times the acceleration of the manoeuvring equations.
    """

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, motor: DcMotor, full_lock: float
    ) -> None:
        super().__init__(model, data, motor, full_lock)
        self._dt = float(model.opt.timestep)
        chassis = model.body("vehicle/chassis")
        self._mass, self._inertia = float(chassis.mass[0]), float(chassis.inertia[2])
        # Address in qvel of the shaft of each propeller, and its position to the left, m.
        self._propellers = {
            part: (
                int(model.joint(f"vehicle/{part}").dofadr[0]),
                float(model.body(f"vehicle/{part}").pos[1]),
            )
            for part in _PROPELLERS
        }
        # Three joints in a row: x, y and yaw.
        self._qpos0 = int(model.joint("vehicle/chassis x").qposadr[0])
        self._qvel0 = int(model.joint("vehicle/chassis x").dofadr[0])
        self._rudder = int(model.joint("vehicle/rudder").qposadr[0])
        self._servo = int(model.actuator("vehicle/rudder").id)
        self._push = data.qfrc_applied
        self._log_m = 0.0
        self._logged_s = 0.0

    def _place_chassis(self, x: float, y: float, heading: float) -> None:
        p, v = self._qpos0, self._qvel0
        self._qpos[p : p + 3] = (x, y, heading)
        self._qvel[v : v + 3] = 0.0
        self._log_m = 0.0
        self._logged_s = float(self._data.time)

    def drive(self, outputs: Outputs, battery_v: float) -> None:
        """Apply outputs and the forces of the water."""
        rudder = outputs.get("rudder", 0.0)
        if rudder is not None:
            self._ctrl[self._servo] = min(1.0, max(-1.0, rudder)) * self._full_lock
        super().drive(outputs, battery_v)
        # Twin propellers steer without a rudder.
        self._apply_water("rudder" in outputs or "propeller" in outputs)

    def motion(self) -> Motion:
        """Current pose, and velocity over ground."""
        heading, cosine, sine, vx, vy, r = self._state()
        x, y = self._qpos[self._qpos0 : self._qpos0 + 2].tolist()
        ahead, left = vx * cosine + vy * sine, vy * cosine - vx * sine
        return Motion(x, y, math.remainder(heading, math.tau), ahead, left, r)

    def travelled_m(self) -> float:
        """Distance through the water since `place`, m; going astern reduces it."""
        return self._log_m

    def _state(self) -> tuple[float, float, float, float, float, float]:
        """Heading, rad, its cosine and sine, velocity over ground, m/s, and rate of turn, rad/s."""
        heading = float(self._qpos[self._qpos0 + 2])
        vx, vy, r = self._qvel[self._qvel0 : self._qvel0 + 3].tolist()
        return heading, math.cos(heading), math.sin(heading), vx, vy, r

    def _apply_water(self, has_rudder: bool) -> None:
        """Apply the forces of the water to the hull and the propellers."""
        _, cosine, sine, vx, vy, r = self._state()
        wx, wy = vx - self._flow[0], vy - self._flow[1]
        u, v = wx * cosine + wy * sine, wy * cosine - wx * sine
        now_s = float(self._data.time)
        # Count whole steps, so that rounding of the time does not change the distance.
        steps = round((now_s - self._logged_s) / self._dt)
        self._log_m += u * self._dt * steps
        self._logged_s = now_s
        x, y, n = _SKEG.force(u, v, r, 0.0)
        flow = u
        for part, propeller in _PROPELLERS.items():
            rate, (dof, aside) = float(self._rates[self._shafts[part][1]]), self._propellers[part]
            if abs(rate) < 1e-3:  # Stopped: neither thrust nor torque.
                self._push[dof] = 0.0
                continue
            thrust, torque = propeller.loads(rate / math.tau, u)
            self._push[dof] = -torque
            push = (1.0 - propeller.thrust_deduction) * thrust
            x += push
            n -= push * aside
            if part == "propeller" and thrust > 0.0 and u >= 0.0:
                # The wash meets a part of the rudder. Forces are proportional to squared speeds,
                # so squared speeds are averaged over the height of the rudder.
                wet = min(1.0, propeller.diameter / _RUDDER.height)
                flow = math.sqrt(wet * propeller.wash(thrust, u) ** 2 + (1.0 - wet) * u * u)
        if has_rudder:
            rx, ry, rn = _RUDDER.force(flow, v, r, float(self._qpos[self._rudder]))
            x, y, n = x + rx, y + ry, n + rn
        # The manoeuvring equations in three degrees of freedom (Fossen, chapter 6). The mass ahead
        # differs from the mass to the side, which gives Coriolis terms.
        pace = math.hypot(u, v)
        x += _ACROSS * v * r - (_SURGE_1 + _SURGE_2 * abs(u)) * u
        y += -_ALONG * u * r - (_SWAY_1 + _SWAY_2 * abs(v) + _SWAY_LIFT * pace) * v
        n += (_ALONG - _ACROSS) * u * v
        n -= (_YAW_1 + _YAW_2 * abs(r) + _YAW_LIFT * pace) * r
        du, dv, dr = x / _ALONG, y / _ACROSS, n / _YAW
        # Convert the rates in the turning frame of the boat to the acceleration in the world. A
        # uniform flow has no effect on it, because u and v are relative to the flow.
        along, across = self._mass * (du - r * v), self._mass * (dv + r * u)
        i = self._qvel0
        self._push[i] = along * cosine - across * sine
        self._push[i + 1] = along * sine + across * cosine
        self._push[i + 2] = self._inertia * dr


BUMPER_SPREAD: Final = math.radians(60.0)
"""Largest bearing, rad, from the middle of the vehicle, at which a contact presses the bumper."""

APART_S: Final = 0.5
"""Longest time between two contacts of the same collision, s."""


class ContactTracker:
    """Tracks contacts of a vehicle with walls and obstacles.

    Names of the vehicle's geoms begin with "vehicle/", walls with "world/wall" and obstacles with
    "world/thing". `bumped` is whether a contact presses the front bumper; `touches` is whether
    there is any contact.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        names = [model.geom(i).name for i in range(model.ngeom)]
        self._hull = np.array([name.startswith("vehicle/") for name in names])
        self._solid = np.array([name.startswith(("world/wall", "world/thing")) for name in names])
        self._solid_ids = frozenset(np.flatnonzero(self._solid).tolist())
        self.reset()

    def reset(self) -> None:
        """Forget all contacts and collisions."""
        self.collisions = 0
        self.release()

    def release(self) -> None:
        """Forget the current contacts, so that the next one is a new collision."""
        self.bumped = self.touches = False
        self._since_s = math.inf

    def follow(self, data: mujoco.MjData, motion: Motion, dt_s: float) -> None:
        """Update from the contacts after `dt_s` seconds of simulation."""
        self._since_s += dt_s
        self.bumped = self.touches = False
        if data.ncon == 0:
            return
        pairs = data.contact.geom
        if self._solid_ids.isdisjoint(pairs.ravel().tolist()):
            return  # Usual case: only the wheels touch the ground.
        first, second = pairs[:, 0], pairs[:, 1]
        hits = (self._hull[first] & self._solid[second]) | (self._hull[second] & self._solid[first])
        hits &= data.contact.dist <= 0.0
        if not hits.any():
            return
        self.touches = True
        if self._since_s > APART_S:
            self.collisions += 1
        self._since_s = 0.0
        for x, y, _ in data.contact.pos[hits]:
            bearing = math.atan2(y - motion.y, x - motion.x) - motion.heading
            self.bumped |= abs(math.remainder(bearing, math.tau)) <= BUMPER_SPREAD
