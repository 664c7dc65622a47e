"""What water does to a small boat: on its hull, its propellers and its rudder.

Surge u is ahead, sway v to the left, r the rate of turn counter-clockwise, all relative to the
water; forces X, Y in N and the moment N in N·m about the middle. Names as in T. I. Fossen,
Handbook of Marine Craft Hydrodynamics and Motion Control, 2nd edition, Wiley 2021.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

__all__ = ["WATER_DENSITY", "Fin", "Hull", "Propeller"]

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
