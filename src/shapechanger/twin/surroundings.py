"""What is around the pins: the world, the sensors in it, and the motors that move it."""

from __future__ import annotations

from typing import Final

from shapechanger.twin.esc import SpeedController
from shapechanger.twin.levels import Levels
from shapechanger.twin.rig import rig_of
from shapechanger.twin.sensors import Edge, PinSensors
from shapechanger.twin.wiring import Wiring
from shapechanger.worlds.world import World

__all__ = ["Surroundings"]

# A board that a busy machine kept waiting for longer does not count that time for its servos: they
# would take its silence for the guard's, and their watchdogs would let go.
_MOST_STILL_NS: Final = 40_000_000


class Surroundings:
    """The world behind the board's pins.

    Args:
        wiring: What is attached.
        world: Where the vehicle is.
        now_ns: The time.

    Attributes:
        sensors: What is on the input pins.
        rig: The servos on a bus; None without any.
        now_ns: How far the world has gone.
    """

    def __init__(self, wiring: Wiring, world: World, now_ns: int) -> None:
        self._wiring = wiring
        self._world = world
        self.sensors = PinSensors(wiring.plan, world)
        self.rig = rig_of(wiring.plan, world)
        self.now_ns = now_ns
        self._controllers = {
            name: SpeedController(plan)
            for name, plan in wiring.outputs.items()
            if plan.driver == "esc"
        }

    def advance(self, now_ns: int, levels: Levels) -> list[Edge]:
        """Let the world go on until now; the edges of inputs on the way."""
        start_ns = self.now_ns
        if now_ns > start_ns:
            if self.rig is not None:
                self.rig.line.advance(min(now_ns - start_ns, _MOST_STILL_NS))
            self._world.advance((now_ns - start_ns) / 1e9, self.parts(levels))
            self.now_ns = now_ns
        return self.sensors.advance(start_ns, self.now_ns, self._world.inputs())

    def parts(self, levels: Levels) -> dict[str, float | None]:
        """What each part of the vehicle gets; the mean where several outputs move one part."""
        values: dict[str, list[float]] = {}
        for name, (value, _) in self._wiring.read(levels, self.now_ns).items():
            part = self._wiring.outputs[name].part
            shares = values.setdefault(part, [])
            if name in self._controllers:
                pulses = self._wiring.has_pulses(name, levels, self.now_ns)
                value = self._controllers[name].obey(value or 0.0, pulses, self.now_ns)
            if value is not None:
                shares.append(value)
        return {part: sum(got) / len(got) if got else None for part, got in values.items()}
