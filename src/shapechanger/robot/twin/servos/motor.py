"""Motor of a servo in current mode, its tendon, and the load at the other end."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Protocol

from shapechanger.robot.drivers.servos.settings import ServoModel

# Heat, all chosen for want of a source: a servo that stalls with half its current gets some 55
# degrees warmer, with a time constant of two minutes.
_ROOM_C: Final = 25.0
_KELVIN_PER_WATT: Final = 30.0
_HEAT_S: Final = 120.0


@dataclass(slots=True)
class Tendon:
    """Tendon between a spool and the load.

    Attributes:
        spool_radius_m: Radius of the spool, m.
        direction: 1 if a positive angle winds in, -1 if it lets out.
        stiffness: Stiffness of cable and frame, N/m. Chosen: a good millimetre for 25 N. The end
            of the load needs a mass of more than 0.01 kg to follow such a spring in steps of 1 ms.
        snapped: Whether it is torn.
    """

    spool_radius_m: float = 0.005
    direction: int = 1
    stiffness: float = 20e3
    snapped: bool = False


class SimulatedMotor:
    """A motor with its gears, its spool and its end of a tendon.

    Args:
        model: Model of the servo.
        tendon: Its tendon.
        angle: Angle of the spool while the tendon is just taut and its far end at 0, rad.

    Attributes:
        angle: Angle of the spool over many turns, rad.
        speed: Speed of the spool, rad/s.
        current: Current, A.
        tension: Tension of the tendon, N.
        temperature: Temperature, degrees Celsius.
    """

    def __init__(self, model: ServoModel, tendon: Tendon, angle: float = 0.0) -> None:
        self._model = model
        self._tendon = tendon
        no_load, gears = model.no_load_rad_per_s, model.gears
        lost = (gears.friction_nm + gears.viscous * no_load) / model.stall_nm
        self._electric_rad_per_s = no_load / (1.0 - lost)  # No current: friction takes some speed.
        self._taut_at = angle
        self.angle = angle
        self.speed = 0.0
        self.current = 0.0
        self.tension = 0.0
        self.temperature = _ROOM_C

    def current_at(self, volts: float) -> float:
        """Return the current at a voltage and the present speed, A."""
        share = volts / self._model.volts - self.speed / self._electric_rad_per_s
        return self._model.stall_a * share

    def advance(self, goal_a: float, volts: float, travel_m: float, dt_s: float) -> None:
        """Turn for one short step.

        Args:
            goal_a: Goal of the current, A; with 0 the motor coasts.
            volts: Voltage of the supply.
            travel_m: How far the tendon's far end is towards the spool, m.
            dt_s: Length of the step, s.
        """
        model, gears, tendon = self._model, self._model.gears, self._tendon
        # The faster it turns, the less current the voltage can still drive.
        least, most = min(self.current_at(-volts), 0.0), max(self.current_at(volts), 0.0)
        self.current = 0.0 if goal_a == 0.0 else min(max(goal_a, least), most)
        lever = tendon.direction * tendon.spool_radius_m
        # Friction and cable use the speed at the end of the step, so that a stiff cable does not
        # need a tiny step.
        inertia = gears.inertia + dt_s * gears.viscous
        torque = model.torque_constant * self.current
        if self._pull(travel_m) > 0.0:
            stretch = lever * (self.angle - self._taut_at) - travel_m
            torque -= lever * tendon.stiffness * stretch
            inertia += (dt_s * lever) ** 2 * tendon.stiffness
        speed = (gears.inertia * self.speed + dt_s * torque) / inertia
        held = dt_s * gears.friction_nm / inertia
        self.speed = math.copysign(max(abs(speed) - held, 0.0), speed)
        self.angle += dt_s * self.speed
        self.tension = self._pull(travel_m)
        self._warm(dt_s)

    def _pull(self, travel_m: float) -> float:
        """Return the tension for the positions of both ends, N."""
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
    """Load at the far ends of all tendons of a bus, such as a finger."""

    def pull(self, tensions_n: Sequence[float], dt_s: float) -> Sequence[float]:
        """Move under these tensions for one step.

        Args:
            tensions_n: Tension of each tendon, N, in the order of the servos; at least 0.
            dt_s: Length of the step, s.

        Returns:
            How far each tendon's end is towards its spool since the beginning, m; negative away
            from it.
        """
        ...


class EndStops:
    """For each tendon a massless spring with a damper between two stops.

    Args:
        count: Number of tendons.
        stiffness: Stiffness of each spring, N/m.
        damping: Damping of each spring, N·s/m.
        nearest_m: How far an end can be pulled, m.
        farthest_m: How far it can go the other way, m; at most 0.

    Attributes:
        travels: How far the ends are towards their spools, m.
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

    def pull(self, tensions_n: Sequence[float], dt_s: float) -> Sequence[float]:
        """Move under these tensions; see `Load.pull`."""
        keep = math.exp(-dt_s / self._lag_s)
        low, high = self._range
        for i, tension in enumerate(tensions_n):
            rest = tension / self._stiffness
            self.travels[i] = min(max(rest + keep * (self.travels[i] - rest), low), high)
        return self.travels
