"""Motor of a servo in current mode, its tendon, and the load at the other end."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Protocol

from shapechanger.errors import UnknownName


@dataclass(frozen=True, slots=True, kw_only=True)
class TwinModel:
    """Model of a servo.

    Attributes:
        number: Model number.
        ampere_per_count: Unit of current registers, A.
        most_counts: Largest current limit, in that unit.
        stall_nm: Stall torque at `volts`, N·m.
        stall_a: Stall current at `volts`, A.
        no_load_rpm: Speed without load at `volts`, turns per minute.
        volts: Nominal voltage, V.
        least_v: Lowest voltage limit, V.
        most_v: Highest voltage limit, V.
        most_c: Temperature limit, degrees Celsius.
        shutdown: Hardware errors that shut it off, as bits.
        inertia: Inertia of motor and gears at the output, kg·m2.
        friction_nm: Coulomb friction at the output, N·m.
        viscous: Viscous friction at the output, N·m·s/rad.
    """

    number: int
    ampere_per_count: float
    most_counts: int
    stall_nm: float
    stall_a: float
    no_load_rpm: float
    volts: float
    least_v: float
    most_v: float
    most_c: int
    shutdown: int
    inertia: float
    friction_nm: float
    viscous: float

    @property
    def torque_constant(self) -> float:
        """Torque at the output per current, N·m/A."""
        return self.stall_nm / self.stall_a

    @property
    def electric_rad_per_s(self) -> float:
        """Speed at which no current flows, above that without load, where friction takes some."""
        no_load = self.no_load_rpm * 2.0 * math.pi / 60.0
        lost = (self.friction_nm + self.viscous * no_load) / self.stall_nm
        return no_load / (1.0 - lost)


# Limits, torques and speeds: ROBOTIS e-manual. Inertia and friction of the XL330-M288: identified
# by Rhoban's `bam` (xl330/m1); of the M077: the same, scaled by the square of the
# gear ratio; of the XC330-M288: fits on joints of a LEAP hand, with the viscous part of the XL330
# assumed; of the XM430: chosen for want of a source.
_X330: Final = {
    "ampere_per_count": 1e-3,
    "volts": 5.0,
    "least_v": 3.5,
    "most_v": 7.0,
    "most_c": 70,
}
_XM430: Final = {
    "ampere_per_count": 2.69e-3,
    "most_counts": 1193,
    "stall_a": 2.3,
    "volts": 12.0,
    "least_v": 9.5,
    "most_v": 16.0,
    "most_c": 80,
    "shutdown": 52,
}
_MODELS: Final = {
    "XL330-M288": {
        **_X330,
        "number": 1200,
        "most_counts": 1750,
        "stall_nm": 0.52,
        "stall_a": 1.47,
        "no_load_rpm": 103.0,
        "shutdown": 53,
        "inertia": 0.00199,
        "friction_nm": 0.018,
        "viscous": 0.0059,
    },
    "XL330-M077": {
        **_X330,
        "number": 1190,
        "most_counts": 1750,
        "stall_nm": 0.215,
        "stall_a": 1.47,
        "no_load_rpm": 383.0,
        "shutdown": 53,
        "inertia": 0.000144,
        "friction_nm": 0.005,
        "viscous": 0.00043,
    },
    "XC330-M288": {
        **_X330,
        "number": 1240,
        "most_counts": 2352,
        "stall_nm": 0.93,
        "stall_a": 1.80,
        "no_load_rpm": 81.0,
        "shutdown": 52,
        "inertia": 0.00141,
        "friction_nm": 0.029,
        "viscous": 0.0059,
    },
    "XM430-W210": {
        **_XM430,
        "number": 1030,
        "stall_nm": 3.0,
        "no_load_rpm": 77.0,
        "inertia": 0.003,
        "friction_nm": 0.09,
        "viscous": 0.02,
    },
    "XM430-W350": {
        **_XM430,
        "number": 1020,
        "stall_nm": 4.1,
        "no_load_rpm": 46.0,
        "inertia": 0.008,
        "friction_nm": 0.12,
        "viscous": 0.05,
    },
}

MODELS: Final[Mapping[str, TwinModel]] = MappingProxyType(
    {name: TwinModel(**numbers) for name, numbers in _MODELS.items()}  # pyright: ignore[reportArgumentType]
)
"""Models of simulated servos, by name."""


def twin_model(name: str) -> TwinModel:
    """Return a model by its name.

    Raises:
        UnknownName: If there is no such model.
    """
    if name not in MODELS:
        raise UnknownName("servo model", name, MODELS)
    return MODELS[name]


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
        """Turn for one short step.

        Args:
            goal_a: Goal of the current, A; with 0 the motor coasts.
            volts: Voltage of the supply.
            travel_m: How far the tendon's far end is towards the spool, m.
            dt_s: Length of the step, s.
        """
        model, tendon = self._model, self._tendon
        # The faster it turns, the less current the voltage can still drive.
        share = volts / model.volts
        free = model.electric_rad_per_s
        most = model.stall_a * (share - self.speed / free)
        least = model.stall_a * (-share - self.speed / free)
        self.current = 0.0 if goal_a == 0.0 else min(max(goal_a, min(least, 0.0)), max(most, 0.0))
        lever = tendon.direction * tendon.spool_radius_m
        # Friction and cable use the speed at the end of the step, so that a stiff cable does not
        # need a tiny step.
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
