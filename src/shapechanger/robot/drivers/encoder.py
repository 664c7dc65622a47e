"""Wheel encoders: speed from the times of their edges."""

from __future__ import annotations

import math
import threading
from collections import deque
from functools import partial
from typing import TYPE_CHECKING, Annotated, Final

from msgspec import Meta

from shapechanger.contract.plan import SensorPlan
from shapechanger.robot.drivers.chip import Keys, SensorChip, device_errors
from shapechanger.robot.drivers.pins import NO_PIN, EdgeInput, OptionalPin, Pin
from shapechanger.robot.drivers.simulation import Edge, SimulatedSensor
from shapechanger.robot.hardware import Hardware

if TYPE_CHECKING:  # Only simulations need these.
    from shapechanger.contract.world import Readings, World

# Time without an edge after which the speed is 0, s.
_STANDS_AFTER_S: Final = 0.5

# Levels of the channels, a and b, as the wheel rolls forward: a leads.
_FORWARD: Final = ((0, 0), (1, 0), (1, 1), (0, 1))


class EncoderKeys(Keys, frozen=True, kw_only=True):
    """Keys of a wheel encoder.

    Attributes:
        a: Pin of its first channel.
        b: Pin of its second channel; -1 without one: the speed then has the sign of the propulsion.
        counts_per_turn: Rising edges of one channel for a turn of the wheel.
        wheel_m: Circumference of the wheel, m.
    """

    a: Pin
    b: OptionalPin = NO_PIN
    counts_per_turn: Annotated[float, Meta(gt=0, le=1e6)]
    wheel_m: Annotated[float, Meta(gt=0, le=100)]

    @property
    def count_m(self) -> float:
        """Distance of a count, m."""
        return self.wheel_m / self.counts_per_turn


class Encoder:
    """Encoder with one or two channels; see `SensorDriver`.

    With two channels (quadrature) it measures the direction, and each edge is a quarter of a count.
    With one channel, each rising edge is a count, and the direction is taken from the propulsion.
    """

    def __init__(self, plan: SensorPlan, hardware: Hardware) -> None:
        keys = EncoderKeys.of(plan.settings)
        self._two_channels = keys.b != NO_PIN
        # Speeds are measured over up to one count, because its edges are unevenly spaced.
        edges_per_count = len(_FORWARD) if self._two_channels else 1
        self._edge_m = keys.count_m / edges_per_count
        self._lock = threading.Lock()  # lgpio calls back from its own thread.
        self._levels = [0, 0]  # A missing channel stays low.
        self._edges: deque[tuple[float, int]] = deque(maxlen=edges_per_count + 1)
        self._has_new = False  # Whether there were edges since the last read.
        self._last_edge_ns = 0
        self._speed = 0.0
        self._sign = 1.0
        pins = [keys.a, keys.b] if self._two_channels else [keys.a]
        with device_errors(f"Sensor {plan.name!r}"):
            factory = hardware.pin_factory()
            self._inputs = [
                EdgeInput(pin, "up", factory, partial(self._changed, channel))
                for channel, pin in enumerate(pins)
            ]
            with self._lock:
                self._levels[: len(pins)] = [one.level for one in self._inputs]

    def read(self, now_ns: int, direction: float) -> dict[str, float]:
        """Return the "speed" in m/s, positive forward."""
        with self._lock:
            edges = list(self._edges)
            has_new, self._has_new = self._has_new, False
        if direction != 0.0:
            self._sign = math.copysign(1.0, direction)
        if has_new:
            self._last_edge_ns, self._speed = now_ns, 0.0
            if len(edges) > 1 and (took_s := edges[-1][0] - edges[0][0]) > 0.0:
                self._speed = sum(step for _, step in edges[1:]) * self._edge_m / took_s
        else:
            # The time since the last edge bounds the speed.
            since_s = (now_ns - self._last_edge_ns) / 1e9
            if since_s > _STANDS_AFTER_S:
                self._speed = 0.0
            elif since_s > 0.0:
                most = self._edge_m / since_s
                self._speed = min(max(self._speed, -most), most)
        return {"speed": self._speed if self._two_channels else self._speed * self._sign}

    def close(self) -> None:
        """Close the pins."""
        for one in self._inputs:
            one.close()

    def _changed(self, channel: int, at_s: float, level: int) -> None:
        with self._lock:
            before = _FORWARD.index((self._levels[0], self._levels[1]))
            self._levels[channel] = level
            turned = _FORWARD.index((self._levels[0], self._levels[1])) - before
            step = (0, 1, 0, -1)[turned % 4] if self._two_channels else level
            if not step:
                return  # The same level again, or the falling edge of a single channel.
            # Edges before a reversal or a stop do not count towards the current speed.
            if self._edges:
                before_s, before_step = self._edges[-1]
                if step != before_step or at_s - before_s > _STANDS_AFTER_S:
                    self._edges.clear()
            self._edges.append((at_s, step))
            self._has_new = True


class SimulatedEncoder(SimulatedSensor):
    """A wheel encoder; forward, channel a leads."""

    def __init__(self, plan: SensorPlan, world: World) -> None:
        keys = EncoderKeys.of(plan.settings)
        self._pins = (keys.a, keys.b)
        self._states = ((0,), (1,)) if keys.b == NO_PIN else _FORWARD
        self._edge_m = keys.count_m / len(self._states)
        # Distance before power-on causes no edges.
        self._travelled = world.inputs().travelled_m
        self._position = math.floor(self._travelled / self._edge_m)
        state = self._states[self._position % len(self._states)]
        # A single channel has no second pin.
        super().__init__(levels=dict(zip(self._pins, state, strict=False)))

    def edges(self, start_ns: int, end_ns: int, seen: Readings) -> list[Edge]:
        """Return an edge for each boundary that the wheel has passed."""
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


ENCODER: Final = SensorChip(
    measures="speed", keys=EncoderKeys, open=Encoder, simulate=SimulatedEncoder
)
