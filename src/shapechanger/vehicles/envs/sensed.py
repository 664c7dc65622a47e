"""A vehicle with the limits and sensors of a robot, but without its programs.

Caps, slew and reflexes are the guard's own functions (`shapechanger.contract.limits`), at its
rate. Sensors measure as the drivers in `shapechanger.robot.drivers` do from the chips of a twin,
with their rates and steps, and without noise. The temperature of the CPU is not simulated.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from shapechanger.contract.limits import Duty, MotionReflexes, aimed, clipped, slewed
from shapechanger.contract.plan import GuardPlan, OutputPlan, output_values
from shapechanger.vehicles.world import MujocoWorld

_STANDS_AFTER_S: Final = 0.5  # Time without an edge after which an encoder is still.
_EDGES_PER_COUNT: Final = 4
# HC-SR04: pings are at least 60 ms apart, and take 0.45 ms; it waits 38 ms for an echo.
_CYCLE_NS: Final = 60_000_000
_PING_NS: Final = 450_000
_NO_ECHO_S: Final = 0.038
_NEAREST_M: Final = 0.02
_FARTHEST_M: Final = 4.0
_SOUND_M_PER_S: Final = 343.2
# MPU-6050 at 4 g and 500 deg/s; the zero of its gyroscope follows its readings at rest.
_M_PER_S2: Final = 9.80665 / 8192.0
_RAD_PER_S: Final = math.radians(1.0) / 65.5
_MOST_ZERO_RAD_PER_S: Final = math.radians(25.0)
_ZERO_SHARE: Final = 0.02
# INA219: read ten times a second, in steps of 4 mV.
_BATTERY_NS: Final = 100_000_000
_V_PER_STEP: Final = 0.004


_Read = Callable[[int, float], dict[str, float]]
"""Readings of a sensor keyed by quantity, at a time, ns, with the sign of the propulsion."""


class WheelEncoder:
    """Speed from an encoder's last edges: those of one count, or two of a single channel."""

    def __init__(self, settings: dict[str, Any], world: MujocoWorld) -> None:
        count_m: float = settings["wheel_m"] / settings["counts_per_turn"]
        self._two_channels: bool = settings["b"] >= 0
        # A single channel has two edges per count, of which the rising one is counted.
        self._pitch_m = count_m / (_EDGES_PER_COUNT if self._two_channels else 2)
        self._edge_m = self._pitch_m if self._two_channels else count_m
        self._world = world
        self._travelled_m, self._read_ns = world.travelled_m, 0
        self._position = math.floor(self._travelled_m / self._pitch_m)
        most = _EDGES_PER_COUNT + 1 if self._two_channels else 2
        self._edges: deque[tuple[float, int]] = deque(maxlen=most)
        self._last_edge_ns = 0
        self._speed = 0.0
        self._sign = 1.0

    def read(self, now_ns: int, direction: float) -> dict[str, float]:
        """Return the "speed", m/s, positive forward; called at each tick of the guard."""
        if direction != 0.0:
            self._sign = math.copysign(1.0, direction)
        if self._roll(now_ns, self._world.travelled_m):
            self._last_edge_ns = now_ns
            (first_s, way), (last_s, _) = self._edges[0], self._edges[-1]
            # All edges have the same direction.
            moved_m = way * (len(self._edges) - 1) * self._edge_m
            self._speed = moved_m / (last_s - first_s) if last_s > first_s else 0.0
        else:  # The time without a new edge limits the speed.
            since_s = (now_ns - self._last_edge_ns) / 1e9
            if since_s > _STANDS_AFTER_S:
                self._speed = 0.0
            elif since_s > 0.0:
                most = self._edge_m / since_s
                self._speed = min(max(self._speed, -most), most)
        return {"speed": self._speed if self._two_channels else self._speed * self._sign}

    def _roll(self, now_ns: int, travelled_m: float) -> bool:
        """Add the edges since the last reading, with their times; return whether there were any."""
        before_m, self._travelled_m = self._travelled_m, travelled_m
        before_ns, self._read_ns = self._read_ns, now_ns
        target = math.floor(travelled_m / self._pitch_m)
        step = 1 if target > self._position else -1
        counted = False
        while self._position != target:
            edge_m = max(self._position, self._position + step) * self._pitch_m
            share = min(max((edge_m - before_m) / (travelled_m - before_m or 1.0), 0.0), 1.0)
            self._position += step
            if not self._two_channels and self._position % 2 == 0:
                continue
            at_s = (before_ns + round(share * (now_ns - before_ns))) / 1e9
            way = step if self._two_channels else 1
            # Edges before a reversal or a stop do not count towards the current speed.
            if self._edges and (way != self._edges[-1][1] or at_s - self._edges[-1][0] > 0.5):
                self._edges.clear()
            self._edges.append((at_s, way))
            counted = True
        return counted


def _sonar(settings: dict[str, Any], world: MujocoWorld) -> _Read:
    """Measure the distance ahead; a later reading receives the echo of a ping."""
    pinged_ns: int | None = None
    echo: tuple[int, float] | None = None
    measured: dict[str, float] = {}

    def read(now_ns: int, direction: float) -> dict[str, float]:
        nonlocal pinged_ns, echo, measured
        if echo is not None and now_ns >= echo[0]:
            measured = {"distance": min(echo[1] * _SOUND_M_PER_S / 2.0, settings["max_m"])}
            echo = None
        if pinged_ns is None or now_ns - pinged_ns >= _CYCLE_NS:
            pinged_ns = now_ns
            distance_m = world.distance_m()
            echo_s = _NO_ECHO_S
            if distance_m <= _FARTHEST_M:
                echo_s = 2.0 * max(distance_m, _NEAREST_M) / _SOUND_M_PER_S
            echo = now_ns + _PING_NS + round(echo_s * 1e9), echo_s
        return measured

    return read


def _inertia(settings: dict[str, Any], world: MujocoWorld) -> _Read:
    zero: float | None = None

    def read(now_ns: int, direction: float) -> dict[str, float]:
        nonlocal zero
        seen = world.inputs()
        rate = _stepped(seen.yaw_rate, _RAD_PER_S)
        if direction == 0.0 and abs(rate) < _MOST_ZERO_RAD_PER_S:
            zero = rate if zero is None else zero + (rate - zero) * _ZERO_SHARE
        return {
            "acceleration_x": _stepped(seen.acceleration_x, _M_PER_S2),
            "acceleration_y": _stepped(seen.acceleration_y, _M_PER_S2),
            "yaw_rate": rate - (zero or 0.0),
        }

    return read


def _battery(settings: dict[str, Any], world: MujocoWorld) -> _Read:
    read_ns: int | None = None
    volts = 0.0

    def read(now_ns: int, direction: float) -> dict[str, float]:
        nonlocal read_ns, volts
        if read_ns is None or now_ns - read_ns >= _BATTERY_NS:
            read_ns = now_ns
            volts = round(world.inputs().battery_v / _V_PER_STEP) * _V_PER_STEP
        return {"battery": volts}

    return read


_SENSORS: Final[dict[str, Callable[[dict[str, Any], MujocoWorld], _Read]]] = {
    "encoder": lambda settings, world: WheelEncoder(settings, world).read,
    "switch": lambda _, world: lambda _ns, _direction: {"bump": float(world.bumped)},
    "hcsr04": _sonar,
    "mpu6050": _inertia,
    "ina219": _battery,
}
"""Simulations of the sensors, keyed by the name of their driver."""

# Quantities whose sensors are read at each tick, because reflexes or counted edges need it.
_AT_EACH_TICK: Final = ("speed", "bump", "distance")


def _stepped(value: float, step: float) -> float:
    return max(-32768, min(32767, round(value / step))) * step


_CLIPPED: Final = "Clipped by the robot's caps."
_OSCILLATOR_MHZ: Final = 25.0  # Oscillator of a PCA9685.
_COUNTS: Final = 4096  # Counts of its period.


class SensedVehicle:
    """A vehicle with the limits and sensors of a robot, which starts at rest.

    Pins, chips, link and emergency stops are simulated only in a robot's twin, which reaches the
    same positions.
    """

    def __init__(self, plan: GuardPlan, world: MujocoWorld) -> None:
        self._plan = plan
        self._world = world
        self._tick_ns = round(1e9 / plan.tick_hz)
        self._steps = [_stepper(output) for output in plan.outputs]
        self.now_ns = 0  # Time since the start.
        self.applied = tuple(action.rest for action in plan.actions)
        self.reason = ""  # Why the vehicle does not follow its command; empty if it does.
        self.quantities: dict[str, float] = {}  # Readings and derived quantities.
        self.sources: dict[str, str] = {}  # Name of the sensor of each quantity, or "estimated".
        self._parts = self._outputs()
        self._reflexes = MotionReflexes(plan)
        self._push = 0.0
        self._measured_by: dict[str, str] = {}
        opened = [
            (one, _SENSORS[one.driver](one.settings, world))
            for one in plan.sensors
            if one.driver in _SENSORS
        ]
        self._fast, self._slow = (
            [(one.name, read) for one, read in opened if (one.measures in _AT_EACH_TICK) == fast]
            for fast in (True, False)
        )

    @property
    def bumps(self) -> int:
        """Number of bumps since the start."""
        return self._reflexes.bump.count

    def advance(self, ns: int, command: Sequence[float] | None) -> None:
        """Advance by `ns`, and apply the limits at each tick; None keeps the applied actions."""
        actions = self._plan.actions
        aims: tuple[float, ...] | None = None
        clips = ""
        if command is not None:
            aims = tuple(map(aimed, actions, command))
            clips = _CLIPPED if any(map(clipped, actions, command)) else ""
        end_ns = self.now_ns + ns
        while self.now_ns < end_ns:
            tick_ns = min(self._tick_ns, end_ns - self.now_ns)
            self.now_ns += tick_ns
            self._world.advance(tick_ns / 1e9, self._parts)
            direction = float((self._push > 0.0) - (self._push < 0.0))
            quantities: dict[str, float] = {}
            if direction == 0.0:  # The gyroscope calibrates its zero.
                self._read(self._slow, quantities, direction)
            self._read(self._fast, quantities, direction)
            self._reflexes.sense(quantities, False, self._push, self.now_ns)
            if self.now_ns >= end_ns:
                if direction != 0.0:
                    self._read(self._slow, quantities, direction)
                self._conclude(quantities)
            if aims is not None:
                kept, reason = self._reflexes.hold_back(aims, self.now_ns)
                self.reason = f"{reason} {clips}".strip()
                if kept != self.applied:
                    self._follow(kept, tick_ns / 1e9)

    def _read(
        self, sensors: Sequence[tuple[str, _Read]], quantities: dict[str, float], direction: float
    ) -> None:
        """Add readings, keyed by quantity; of two measured speeds, the smaller one counts."""
        for name, read in sensors:
            for quantity, value in read(self.now_ns, direction).items():
                if quantity == "speed" and abs(value) >= abs(quantities.get(quantity, math.inf)):
                    continue
                quantities[quantity], self._measured_by[quantity] = value, name

    def _conclude(self, quantities: dict[str, float]) -> None:
        """Add derived quantities: stalls, an estimated speed, and collisions."""
        reflexes, sources = self._reflexes, dict(self._measured_by)
        if reflexes.stall.watches:
            quantities["stall"] = float(reflexes.stall.way != 0)
            sources["stall"] = sources["speed"]
        speed = reflexes.propulsion.speed(self.applied)
        if "speed" not in quantities and speed is not None:
            quantities["speed"], sources["speed"] = speed, "estimated"
        bump, stall = quantities.get("bump"), quantities.get("stall", 0.0)
        if bump is not None and (bump > 0.0 or stall == 0.0):
            quantities["collision"], sources["collision"] = bump, sources["bump"]
        elif "stall" in quantities:
            quantities["collision"], sources["collision"] = stall, "estimated"
        self.quantities, self.sources = quantities, sources

    def _follow(self, aims: tuple[float, ...], elapsed_s: float) -> None:
        self.applied = tuple(
            slewed(action, now, aim, elapsed_s)
            for action, now, aim in zip(self._plan.actions, self.applied, aims, strict=True)
        )
        self._push = self._reflexes.propulsion.push(self.applied)
        self._parts = self._outputs()

    def _outputs(self) -> Mapping[str, float | None]:
        """Return each part's output in its driver's steps; the mean if several move the part."""
        shares: dict[str, list[float]] = {}
        values = output_values(self._plan, self.applied)
        for output, step, value in zip(self._plan.outputs, self._steps, values, strict=True):
            shares.setdefault(output.part, []).append(step(value))
        return {part: sum(values) / len(values) for part, values in shares.items()}


def _stepper(output: OutputPlan) -> Callable[[float], float]:
    """Round values to the duties or pulse widths of an output."""
    settings = output.settings
    if output.driver in ("hbridge", "phase_enable"):
        duty = Duty(settings["start"], settings["full"])
        return lambda value: math.copysign(duty.size_at(duty.of(value)), value)
    if output.driver != "servo":
        return lambda value: value
    low, middle, high = (settings[key] for key in ("left_us", "centre_us", "right_us"))
    step_us = 1.0
    if settings["over"] == "pca9685":
        step_us = round(_OSCILLATOR_MHZ * 1e6 / (_COUNTS * settings["hz"])) / _OSCILLATOR_MHZ

    def stepped(value: float) -> float:
        end = high if value > 0.0 else low
        wanted = middle + (end - middle) * min(abs(value), 1.0)
        off = round(wanted / step_us) * step_us - middle
        share = off / (high - middle)
        return share if share >= 0.0 else -off / (low - middle)

    return stepped
