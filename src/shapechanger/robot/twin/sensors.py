"""Sensors, controllers and servos of a simulated board, and the world that moves them."""

from __future__ import annotations

import heapq
from typing import Final, TypeVar

from shapechanger.contract.plan import GuardPlan
from shapechanger.contract.world import Readings, World
from shapechanger.robot.drivers.chip import OUTPUTS, SENSORS
from shapechanger.robot.drivers.servos.rig import Rig
from shapechanger.robot.drivers.servos.settings import DRIVER
from shapechanger.robot.drivers.simulation import Edge, Levels, SimulatedSensor
from shapechanger.robot.twin.wiring import TwinWiring

_Sensor = TypeVar("_Sensor", bound=SimulatedSensor)


class BoardSensors:
    """All sensors, and the emergency stop button."""

    def __init__(self, plan: GuardPlan, world: World) -> None:
        self.sensors = {
            one.name: simulate(one, world)
            for one in plan.sensors
            if (simulate := SENSORS[one.driver].simulate) is not None
        }
        self._stop_pin = plan.stop_pin
        self._due: list[Edge] = []
        self.levels: dict[int, int] = {}
        for sensor in self.sensors.values():
            self.levels.update(sensor.levels)
        if self._stop_pin is not None:
            self.levels[self._stop_pin] = 1  # A button to ground, with a pull-up.
        self._stop_held = False

    def advance(self, start_ns: int, end_ns: int, seen: Readings) -> list[Edge]:
        """Return the edges between two times, in order."""
        found: list[Edge] = []
        for sensor in self.sensors.values():
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
        """Let sensors react to an output; see `SimulatedSensor.output_changed`."""
        for sensor in self.sensors.values():
            for edge in sensor.output_changed(t, pin, level):
                heapq.heappush(self._due, edge)

    def press_stop(self, down: bool) -> None:
        """Press or release the stop button; its level changes at the end of the next `advance`."""
        self._stop_held = down

    def of_kind(self, kind: type[_Sensor]) -> list[_Sensor]:
        """Return the sensors of one kind."""
        return [one for one in self.sensors.values() if isinstance(one, kind)]


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
        sensors: The sensors.
        rig: Servos on a bus; None without any.
        now_ns: Time to which the world has advanced.
    """

    def __init__(self, wiring: TwinWiring, world: World, now_ns: int) -> None:
        self._wiring = wiring
        self._world = world
        self.sensors = BoardSensors(wiring.plan, world)
        has_bus = any(output.driver == DRIVER for output in wiring.plan.outputs)
        self.rig = Rig(wiring.plan.outputs, world) if has_bus else None
        self.now_ns = now_ns
        self._obeys = {
            name: obeys(plan)
            for name, plan in wiring.outputs.items()
            if (obeys := OUTPUTS[plan.driver].obeys) is not None
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
            if name in self._obeys:
                value = self._obeys[name](value, self.now_ns)
            if value is not None:
                shares.append(value)
        return {part: sum(got) / len(got) if got else None for part, got in values.items()}
