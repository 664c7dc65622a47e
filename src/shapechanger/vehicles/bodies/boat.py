"""Boat: a hull with a central propeller, a rudder and twin propellers.

A robot drives either the central propeller and the rudder, or the twin propellers. Parts that the
robot does not drive stay still and have no effect.

Surge u points ahead and sway v to the left, relative to the water. The rate of turn r is
counter-clockwise. X and Y are forces, N, and N is the moment about the middle, N·m. Names
follow T. I. Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control, 2nd ed., Wiley 2021.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import mujoco

from shapechanger.vehicles.bodies.model import BoundVehicle, Motion, Outputs
from shapechanger.vehicles.bodies.parts import DcMotor

_WATER_DENSITY: Final = 1000.0  # kg/m3, fresh
# Share of the speed gained behind a propeller that the water has gained at the rudder: 0.6 in H.
# Yasukawa, Y. Yoshimura, Introduction of MMG standard method, J. Mar. Sci. Technol. 20 (2015).
_CONTRACTED: Final = 0.6


@dataclass(frozen=True, slots=True)
class Propeller:
    """A propeller whose thrust and torque are linear in the advance ratio J = V / (n D).

    Attributes:
        diameter: Diameter, m.
        thrust: Thrust coefficient at J = 0.
        zero_thrust_j: J at which the thrust is 0.
        torque: Torque coefficient at J = 0.
        zero_torque_j: J at which the torque is 0.
        astern: Factor on thrust and torque when turning backwards.
        wake: Speed of the water at the propeller, divided by the speed of the boat.
        thrust_deduction: Share of the thrust that is lost, because it sucks water from the hull.
    """

    diameter: float
    thrust: float
    zero_thrust_j: float
    torque: float
    zero_torque_j: float
    astern: float
    wake: float
    thrust_deduction: float

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

    The simulated body has the dry mass. The applied force is that mass times the acceleration of
    the manoeuvring equations.
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
        """Distance through the water since `place`; astern counts down."""
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
        # Whole steps: the same drive is equally long at any time, in spite of rounding.
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
        # From rates in the turning frame of the boat to the acceleration in the world. A uniform
        # flow adds nothing, because u and v are relative to it.
        along, across = self._mass * (du - r * v), self._mass * (dv + r * u)
        i = self._qvel0
        self._push[i] = along * cosine - across * sine
        self._push[i + 1] = along * sine + across * cosine
        self._push[i + 2] = self._inertia * dr
