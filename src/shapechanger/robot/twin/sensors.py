"""Around the board: sensors on input pins, speed controllers, and the world that moves them."""

from __future__ import annotations

import heapq
import math
from typing import Final

from shapechanger.contract.world import Readings, World
from shapechanger.robot.drivers.servos.settings import DRIVER
from shapechanger.robot.guard.plan import GuardPlan, OutputPlan, SensorPlan
from shapechanger.robot.twin.messages import Edge
from shapechanger.robot.twin.servos.rig import Rig
from shapechanger.robot.twin.signals import Levels
from shapechanger.robot.twin.wiring import TwinWiring

# HC-SR04, from its user guide: a ping takes eight cycles of 40 kHz, and the echo line is high for
# as long as the sound travels; after 38 ms without an echo it gives up. It measures 2 cm to 4 m.
_PING_NS: Final = 450_000
_NO_ECHO_NS: Final = 38_000_000
_NEAREST_M: Final = 0.02
_FARTHEST_M: Final = 4.0
_SOUND_M_PER_S: Final = 343.2


class _Encoder:
    """A wheel encoder; forward, channel a leads."""

    def __init__(self, plan: SensorPlan, travelled_m: float) -> None:
        self._pins = (plan.settings["a"], plan.settings["b"])
        self._states = ((0, 0), (1, 0), (1, 1), (0, 1)) if self._pins[1] >= 0 else ((0,), (1,))
        count_m: float = plan.settings["wheel_m"] / plan.settings["counts_per_turn"]
        self._edge_m = count_m / len(self._states)
        # The distance rolled before power-on makes no edges.
        self._travelled = travelled_m
        self._position = math.floor(travelled_m / self._edge_m)

    def levels(self) -> dict[int, int]:
        state = self._states[self._position % len(self._states)]
        return dict(zip(self._pins, state, strict=False))  # A single channel has no second pin.

    def edges(self, start_ns: int, end_ns: int, seen: Readings) -> list[Edge]:
        before, self._travelled = self._travelled, seen.travelled_m
        found: list[Edge] = []
        target = math.floor(seen.travelled_m / self._edge_m)
        step = 1 if target > self._position else -1
        while self._position != target:
            boundary = max(self._position, self._position + step) * self._edge_m
            share = (boundary - before) / (seen.travelled_m - before or 1.0)
            t = start_ns + round(min(max(share, 0.0), 1.0) * (end_ns - start_ns))
            old = self._states[self._position % len(self._states)]
            self._position += step
            new = self._states[self._position % len(self._states)]
            for pin, was, level in zip(self._pins, old, new, strict=False):
                if was != level:
                    found.append(Edge(t, pin, level))
        return found


class _Bumper:
    """Bumper switches to ground (pull "up") or to 3.3 V, all pressed at once."""

    def __init__(self, plan: SensorPlan) -> None:
        self._pins: list[int] = plan.settings["pins"]
        self._open = int(plan.settings["pull"] == "up")
        self._pressed = False
        self.held = False

    def levels(self) -> dict[int, int]:
        return dict.fromkeys(self._pins, self._open ^ self._pressed)

    def edges(self, start_ns: int, end_ns: int, seen: Readings) -> list[Edge]:
        pressed = seen.bumped or self.held
        if pressed == self._pressed:
            return []
        self._pressed = pressed
        return [Edge(end_ns, pin, level) for pin, level in self.levels().items()]


class _Distance:
    """An HC-SR04."""

    def __init__(self, plan: SensorPlan, world: World) -> None:
        self.trigger = plan.settings["trigger"]
        self._echo = plan.settings["echo"]
        self._world = world
        self._busy_until_ns = 0
        self.override_m: float | None = None
        self.dead = False

    def levels(self) -> dict[int, int]:
        return {self._echo: 0}

    def ping(self, t: int) -> list[Edge]:
        if self.dead or t < self._busy_until_ns:
            return []
        distance = self._world.distance_m() if self.override_m is None else self.override_m
        echo_ns = _NO_ECHO_NS
        if distance <= _FARTHEST_M:
            echo_ns = round(2e9 * max(distance, _NEAREST_M) / _SOUND_M_PER_S)
        self._busy_until_ns = t + _PING_NS + echo_ns
        return [Edge(t + _PING_NS, self._echo, 1), Edge(self._busy_until_ns, self._echo, 0)]


class PinSensors:
    """All sensors on pins.

    Args:
        plan: The robot as it is wired.
        world: World of the robot.

    Attributes:
        levels: Level of each pin that a sensor drives.
    """

    def __init__(self, plan: GuardPlan, world: World) -> None:
        rolled_m = world.inputs().travelled_m
        encoders = (one for one in plan.sensors if one.driver == "encoder")
        self._encoders = [_Encoder(one, rolled_m) for one in encoders]
        self._bumpers = [_Bumper(one) for one in plan.sensors if one.driver == "switch"]
        self._distances = [_Distance(one, world) for one in plan.sensors if one.driver == "hcsr04"]
        self._stop_pin = plan.stop_pin
        self._due: list[Edge] = []
        self.levels: dict[int, int] = {}
        for sensor in (*self._encoders, *self._bumpers, *self._distances):
            self.levels.update(sensor.levels())
        if self._stop_pin is not None:
            self.levels[self._stop_pin] = 1  # A button to ground, with a pull-up.
        self._stop_held = False

    @property
    def next_ns(self) -> int | None:
        """Time of the next edge that is already known, ns; None without one."""
        return self._due[0].t if self._due else None

    def advance(self, start_ns: int, end_ns: int, seen: Readings) -> list[Edge]:
        """Return the edges between two times, in order.

        Args:
            start_ns: End of the last call.
            end_ns: Current time.
            seen: Current state of the world.
        """
        found: list[Edge] = []
        for sensor in (*self._encoders, *self._bumpers):
            found += sensor.edges(start_ns, end_ns, seen)
        while self._due and self._due[0].t <= end_ns:
            found.append(heapq.heappop(self._due))
        stop_level = int(not self._stop_held)
        if self._stop_pin is not None and self.levels[self._stop_pin] != stop_level:
            found.append(Edge(end_ns, self._stop_pin, stop_level))
        found.sort()
        for edge in found:
            self.levels[edge.pin] = edge.level
        return found

    def output_changed(self, t: int, pin: int, level: float) -> None:
        """Let a distance sensor ping when its trigger, an output, falls.

        Args:
            t: Time, ns.
            pin: BCM number of the output.
            level: Its level or duty, 0 to 1.
        """
        for sensor in self._distances:
            if sensor.trigger == pin and level == 0.0:
                for edge in sensor.ping(t):
                    heapq.heappush(self._due, edge)

    def press_stop(self, down: bool) -> None:
        """Press or release the stop button; its level changes at the end of the next `advance`."""
        self._stop_held = down

    def hold_bumpers(self, down: bool) -> None:
        """Press or release all bumpers from outside the world, likewise."""
        for bumper in self._bumpers:
            bumper.held = down

    def override_distance(self, distance_m: float | None, *, dead: bool = False) -> None:
        """Override what distance sensors measure.

        Args:
            distance_m: Distance to measure, m; None for the truth.
            dead: Whether they do not answer at all.
        """
        for sensor in self._distances:
            sensor.override_m, sensor.dead = distance_m, dead


# A controller arms a little earlier than its driver expects.
_ARM_SHARE: Final = 0.8


class SpeedController:
    """Hobby speed controller: turns the value of its pulses into that of the motor.

    With `reverse` "double" the first backward pulses after driving forward brake; only those after
    another neutral drive backward.

    Args:
        plan: Its output.
    """

    def __init__(self, plan: OutputPlan) -> None:
        self._reverse = plan.settings["reverse"]
        self._arm_ns = plan.settings["arm_s"] * 1e9 * _ARM_SHARE
        self._neutral_since_ns: int | None = None
        self._armed = False
        self._braked = False
        self._reverses = False

    def obey(self, value: float | None, now_ns: int) -> float:
        """Return the value for the motor, -1 to 1.

        Args:
            value: Value of the pulses, -1 to 1; None without pulses or power, when it stops and
                must see neutral again.
            now_ns: Time, ns.
        """
        if value is None:
            self._neutral_since_ns = None
            self._armed = self._braked = self._reverses = False
            return 0.0
        if value == 0.0:
            if self._neutral_since_ns is None:
                self._neutral_since_ns = now_ns
            self._armed = self._armed or now_ns - self._neutral_since_ns >= self._arm_ns
            self._reverses = self._reverses or self._braked
            return 0.0
        self._neutral_since_ns = None
        if not self._armed:
            return 0.0
        if value > 0.0:
            self._braked = self._reverses = False
            return value
        if self._reverse == "direct" or (self._reverse == "double" and self._reverses):
            return value
        self._braked = True
        return 0.0


# Servos do not count longer times for which a busy machine kept the board waiting: their watchdogs
# would take its silence for the guard's and let go.
_MAX_SERVO_STEP_NS: Final = 40_000_000


class Surroundings:
    """Everything around the board: sensors, speed controllers, servos and world.

    Args:
        wiring: What is attached to the pins.
        world: World of the robot.
        now_ns: Time, ns.

    Attributes:
        sensors: Sensors on input pins.
        rig: Servos on a bus; None without any.
        now_ns: Time to which the world has advanced.
    """

    def __init__(self, wiring: TwinWiring, world: World, now_ns: int) -> None:
        self._wiring = wiring
        self._world = world
        self.sensors = PinSensors(wiring.plan, world)
        has_bus = any(output.driver == DRIVER for output in wiring.plan.outputs)
        self.rig = Rig(wiring.plan, world) if has_bus else None
        self.now_ns = now_ns
        self._controllers = {
            name: SpeedController(plan)
            for name, plan in wiring.outputs.items()
            if plan.driver == "esc"
        }

    def advance(self, now_ns: int, levels: Levels) -> list[Edge]:
        """Advance the world to a time and return the edges of inputs on the way.

        Args:
            now_ns: The time, ns.
            levels: State of all outputs.
        """
        start_ns = self.now_ns
        if now_ns > start_ns:
            if self.rig is not None:
                if self.rig.is_switched:
                    ends_ns = self._wiring.power_ends_ns(levels)
                    self.rig.bus.set_power(on=ends_ns is None or now_ns < ends_ns)
                self.rig.bus.advance(min(now_ns - start_ns, _MAX_SERVO_STEP_NS))
            self._world.advance((now_ns - start_ns) / 1e9, self.parts(levels))
            self.now_ns = now_ns
        return self.sensors.advance(start_ns, self.now_ns, self._world.inputs())

    def parts(self, levels: Levels) -> dict[str, float | None]:
        """Return the value of each part of the vehicle; the mean of outputs that share a part."""
        values: dict[str, list[float]] = {}
        for name, (value, _) in self._wiring.read(levels, self.now_ns).items():
            part = self._wiring.outputs[name].part
            shares = values.setdefault(part, [])
            if name in self._controllers:
                value = self._controllers[name].obey(value, self.now_ns)
            if value is not None:
                shares.append(value)
        return {part: sum(got) / len(got) if got else None for part, got in values.items()}
