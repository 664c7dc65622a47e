"""What a robot's limits make of commands: caps, slew, reflexes and the steps of its outputs.

The functions are the guard's own (`shapechanger.robot.guard.limits`), at the guard's own rate.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Final

from shapechanger.robot.drivers.duty import Duty
from shapechanger.robot.guard.limits import (
    MotionReflexes,
    aimed,
    bump_blocks,
    bump_ends_ns,
    clipped,
    forward_actions,
    slewed,
)
from shapechanger.robot.guard.plan import GuardPlan, OutputPlan, output_values
from shapechanger.vehicles.envs.sensors import SimulatedSensors
from shapechanger.vehicles.world import MujocoWorld

_CLIPPED: Final = "Clipped by the robot's caps."
_OSCILLATOR_MHZ: Final = 25.0  # Of a PCA9685.
_COUNTS: Final = 4096  # Of its period.


class MeanOutputs:
    """Mean outputs of a control period, without sensors and without the steps of outputs.

    It leaves out deadlines, which a simulated command never misses, and stalls.

    Args:
        plan: Plan of the guard.

    Attributes:
        applied: Value of each action at the end of the last period.
        tick_s: Period of the guard, s.
    """

    def __init__(self, plan: GuardPlan) -> None:
        self._plan = plan
        self.tick_s = 1.0 / plan.tick_hz
        self._tick_ns = round(1e9 / plan.tick_hz)
        self._forward = forward_actions(plan.actions)
        self.reset()

    def reset(self) -> None:
        """Bring all actions to rest."""
        self.applied = tuple(action.rest for action in self._plan.actions)
        self._now_ns = 0
        self._block_ends_ns: int | None = None

    def outputs(
        self, values: tuple[float, ...], bumped: bool, ticks: int
    ) -> Mapping[str, float | None]:
        """Return the mean output of each part over a control period.

        Args:
            values: The command, one value for each action.
            bumped: Whether the bumper is pressed.
            ticks: Ticks of the guard in the period.
        """
        hold_ms = self._plan.limits.bump_hold_ms
        self._block_ends_ns = bump_ends_ns(bumped, self._now_ns, self._block_ends_ns, hold_ms)
        actions = self._plan.actions
        aims = [aimed(action, value) for action, value in zip(actions, values, strict=True)]
        if bump_blocks(bumped, self._now_ns, self._block_ends_ns):
            for i in self._forward:
                aims[i] = min(aims[i], actions[i].rest)
        self._now_ns += ticks * self._tick_ns
        target = tuple(aims)
        total = [0.0] * len(self._plan.outputs)
        left = ticks
        while left:
            # Once at the target, the rest of the period is alike.
            alike = left if self.applied == target else 1
            left -= alike
            values_now = output_values(self._plan, self.applied)
            total = [one + alike * now for one, now in zip(total, values_now, strict=True)]
            if alike == 1:
                self.applied = tuple(
                    slewed(action, now, aim, self.tick_s)
                    for action, now, aim in zip(actions, self.applied, target, strict=True)
                )
        outputs = self._plan.outputs
        return {out.part: one / ticks for out, one in zip(outputs, total, strict=True)}


class SensedVehicle:
    """A vehicle that moves within a robot's limits and senses what the robot would.

    It is the robot without pins, chips, link and emergency stops: `InProcessRobot` of
    `shapechanger.twin.in_process` emulates those, and drives to the same place.

    Args:
        plan: Plan of the guard.
        world: The world.

    Attributes:
        now_ns: Time since the start, ns.
        applied: Value of each action.
        reason: Why the vehicle does not follow its command; empty if it does.
        quantities: Readings keyed by name, and what follows from them.
        sources: Name of the sensor behind each, or "estimated".
    """

    def __init__(self, plan: GuardPlan, world: MujocoWorld) -> None:
        self._plan = plan
        self._world = world
        self._tick_ns = round(1e9 / plan.tick_hz)
        self._steps = [_stepper(output) for output in plan.outputs]
        self.start()

    def start(self) -> None:
        """Bring all actions to rest, and begin to sense."""
        self.now_ns = 0
        self.applied = tuple(action.rest for action in self._plan.actions)
        self.reason = ""
        self.quantities: dict[str, float] = {}
        self.sources: dict[str, str] = {}
        self._parts = self._outputs()
        self._reflexes = MotionReflexes(self._plan)
        self._sensors = SimulatedSensors(self._plan.sensors, self._world, self.now_ns)

    @property
    def bumps(self) -> int:
        """Number of bumps since the start."""
        return self._reflexes.bump.count

    def advance(self, ns: int, command: Sequence[float] | None) -> None:
        """Advance time, with a round of the limits at each tick.

        Args:
            ns: Duration, ns.
            command: One value for each action; None to rest.
        """
        actions = self._plan.actions
        aims: tuple[float, ...] | None = None
        clips = ""
        if command is not None:
            aims = tuple(aimed(a, value) for a, value in zip(actions, command, strict=True))
            clips = _CLIPPED if any(map(clipped, actions, command)) else ""
        end_ns = self.now_ns + ns
        while self.now_ns < end_ns:
            tick_ns = min(self._tick_ns, end_ns - self.now_ns)
            self.now_ns += tick_ns
            self._world.advance(tick_ns / 1e9, self._parts)
            push = self._reflexes.propulsion.push(self.applied)
            direction = float((push > 0.0) - (push < 0.0))
            quantities = self._sensors.read(self.now_ns, direction)
            self._reflexes.sense(quantities, False, self.applied, self.now_ns)
            if self.now_ns >= end_ns:
                if direction != 0.0:
                    self._sensors.complete(quantities, self.now_ns, direction)
                self._conclude(quantities)
            if aims is not None:
                kept, reason = self._reflexes.hold_back(aims, self.now_ns)
                self.reason = f"{reason} {clips}".strip()
                self._follow(kept, tick_ns / 1e9)

    def _conclude(self, quantities: dict[str, float]) -> None:
        """Add what follows from the readings: stalls, an estimated speed, and collisions."""
        reflexes, sources = self._reflexes, dict(self._sensors.sources)
        if reflexes.stall.watches:
            quantities["stall"] = float(reflexes.stall.way != 0)
            sources["stall"] = sources["speed"]
        speed = reflexes.propulsion.speed(self.applied)
        if "speed" not in quantities and speed is not None:
            quantities["speed"], sources["speed"] = speed, "estimated"
        signs = [name for name in ("bump", "stall") if name in quantities]
        if signs:
            sign = next((name for name in signs if quantities[name] > 0.0), signs[0])
            quantities["collision"] = float(quantities[sign] > 0.0)
            sources["collision"] = "estimated" if sign == "stall" else sources[sign]
        self.quantities, self.sources = quantities, sources

    def _follow(self, aims: tuple[float, ...], elapsed_s: float) -> None:
        if aims == self.applied:
            return
        self.applied = tuple(
            slewed(action, now, aim, elapsed_s)
            for action, now, aim in zip(self._plan.actions, self.applied, aims, strict=True)
        )
        self._parts = self._outputs()

    def _outputs(self) -> Mapping[str, float | None]:
        """Return the output of each part, in the steps of its driver; the mean of shared parts."""
        shares: dict[str, list[float]] = {}
        values = output_values(self._plan, self.applied)
        for output, step, value in zip(self._plan.outputs, self._steps, values, strict=True):
            shares.setdefault(output.part, []).append(step(value))
        return {part: sum(values) / len(values) for part, values in shares.items()}


def _stepper(output: OutputPlan) -> Callable[[float], float]:
    """Return what rounds a value to the duties or pulse widths that an output has."""
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
