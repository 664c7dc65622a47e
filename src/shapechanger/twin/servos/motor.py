"""How a servo in current mode turns: current, torque, friction, inertia, heat."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Protocol

from shapechanger.twin.servos.models import TwinModel

__all__ = ["EndStops", "Load", "SimulatedMotor", "Tendon"]

# Heat, all chosen: a servo that stalls with half its current gets some 55 degrees warmer, with a
# time constant of two minutes. Nothing was found that says so.
_ROOM_C: Final = 25.0
_KELVIN_PER_WATT: Final = 30.0
_HEAT_S: Final = 120.0


@dataclass(slots=True)
class Tendon:
    """What connects a spool to the load.

    Attributes:
        spool_radius_m: m.
        direction: 1 if a positive angle winds in.
        stiffness: Of cable and frame, N/m. Chosen: a good millimetre for 25 N. A load whose end
            has a mass of m kg must be able to follow a spring of this stiffness in steps of 1 ms:
            m should be more than 0.01 kg.
        snapped: Whether it is torn.
    """

    spool_radius_m: float = 0.005
    direction: int = 1
    stiffness: float = 20e3
    snapped: bool = False


class SimulatedMotor:
    """One motor with its gears, its spool and its end of a tendon.

    Args:
        model: Which model.
        tendon: What it pulls.
        angle: Where its spool is while the tendon is just taut and its far end at 0, rad.

    Attributes:
        angle: rad, over many turns.
        speed: rad/s.
        current: What flows, A.
        tension: What pulls at the tendon, N.
        temperature: Degrees Celsius.
    """

    def __init__(self, model: TwinModel, tendon: Tendon, angle: float = 0.0) -> None:
        self._model = model
        self._tendon = tendon
        self._taut_at = angle
        self.angle = angle
        self.speed = 0.0
        self.current = 0.0
        self.tension = 0.0
        self.temperature = _ROOM_C

    def advance(self, goal_a: float, volts: float, travel_m: float, dt_s: float) -> None:
        """Turn for a short time.

        Args:
            goal_a: Current that is wanted, A; 0 lets it coast.
            volts: Of its supply.
            travel_m: Where the tendon's far end is, m towards the spool.
            dt_s: How long.
        """
        model, tendon = self._model, self._tendon
        # The faster it turns, the less current the voltage can still drive.
        share = volts / model.volts
        free = model.electric_rad_per_s
        most = model.stall_a * (share - self.speed / free)
        least = model.stall_a * (-share - self.speed / free)
        self.current = 0.0 if goal_a == 0.0 else min(max(goal_a, min(least, 0.0)), max(most, 0.0))
        lever = tendon.direction * tendon.spool_radius_m
        # Speeds are those at the end of the step, in friction and cable too, so that a stiff cable
        # does not need a tiny step.
        inertia = model.inertia + dt_s * model.viscous
        torque = model.torque_constant * self.current
        if self._pull(travel_m) > 0.0:
            stretch = lever * (self.angle - self._taut_at) - travel_m
            torque -= lever * tendon.stiffness * stretch
            inertia += (dt_s * lever) ** 2 * tendon.stiffness
        speed = (model.inertia * self.speed + dt_s * torque) / inertia
        held = dt_s * model.friction_nm / inertia
        self.speed = math.copysign(max(abs(speed) - held, 0.0), speed)
        self.angle += dt_s * self.speed
        self.tension = self._pull(travel_m)
        self._warm(dt_s)

    def _pull(self, travel_m: float) -> float:
        """Tension for where both ends are, N."""
        tendon = self._tendon
        if tendon.snapped:
            return 0.0
        stretch = tendon.direction * tendon.spool_radius_m * (self.angle - self._taut_at) - travel_m
        return max(0.0, tendon.stiffness * stretch)

    def _warm(self, dt_s: float) -> None:
        ohm = self._model.volts / self._model.stall_a
        warm = _ROOM_C + _KELVIN_PER_WATT * ohm * self.current**2
        self.temperature += (warm - self.temperature) * -math.expm1(-dt_s / _HEAT_S)


class Load(Protocol):
    """What is at the far end of all tendons of a line, such as a finger."""

    def pull(self, tensions_n: Sequence[float], dt_s: float) -> Sequence[float]:
        """Let some time go by under these tensions.

        Args:
            tensions_n: N for each tendon, in the order of the servos; never below 0.
            dt_s: How long they act.

        Returns:
            How far each tendon's end has moved towards its spool since the beginning, m; below 0
            for away from it.
        """
        ...


class EndStops:
    """For each tendon a spring with a damper between two stops; it has no mass.

    Args:
        count: How many tendons.
        stiffness: N/m.
        damping: N·s/m.
        nearest_m: How far an end can be pulled, m.
        farthest_m: How far it can go the other way, m; 0 or below.
    """

    def __init__(
        self,
        count: int,
        stiffness: float = 300.0,
        damping: float = 60.0,
        nearest_m: float = 0.02,
        farthest_m: float = 0.0,
    ) -> None:
        self._stiffness = stiffness
        self._lag_s = damping / stiffness
        self._range = (farthest_m, nearest_m)
        self.travels = [0.0] * count
        """Where the ends are, m."""

    def pull(self, tensions_n: Sequence[float], dt_s: float) -> Sequence[float]:
        """Let some time go by; see `Load`."""
        keep = math.exp(-dt_s / self._lag_s)
        low, high = self._range
        for i, tension in enumerate(tensions_n):
            rest = tension / self._stiffness
            self.travels[i] = min(max(rest + keep * (self.travels[i] - rest), low), high)
        return self.travels
