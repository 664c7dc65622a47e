"""What a robot is made of."""

from __future__ import annotations

import dataclasses
import datetime
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from shapechanger.layout import Element, Feature, Layout
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.guard.plan import (
    ActionPlan,
    GuardPlan,
    LimitPlan,
    OutputPlan,
    SensorPlan,
    StopPlan,
)
from shapechanger.robot.profile.quantities import APPLIED, state_features
from shapechanger.robot.profile.servo_bus import tension_spans

__all__ = ["EnablePlan", "Profile", "ResetStep", "RewardPlan"]

# The layout is in SI units, a profile may be in degrees.
_SI: Final = {"deg": ("rad", math.pi / 180.0)}


@dataclass(frozen=True, slots=True)
class RewardPlan:
    """Weights of the task.

    Attributes:
        velocity: Reward for a metre forward, 1/m.
        collision: Reward for a collision, at most 0.
        stall: Reward for a second of pushing without moving, 1/s, at most 0.
        collision_ends_episode: Whether a collision ends the task.
    """

    velocity: float = 1.0
    collision: float = -10.0
    stall: float = -1.0
    collision_ends_episode: bool = True


@dataclass(frozen=True, slots=True)
class ResetStep:
    """One step of the routine that brings the robot back.

    Attributes:
        values: One number for each action, in order.
        seconds: How long it lasts.
    """

    values: tuple[float, ...]
    seconds: float


@dataclass(frozen=True, slots=True)
class EnablePlan:
    """The one-shot that holds the enable line of the motors while the guard toggles a pin.

    Attributes:
        pin: BCM pin that is toggled.
        hold_ms: How long the one-shot holds the line after the last toggle.
    """

    pin: int
    hold_ms: int


@dataclass(frozen=True, slots=True)
class Profile:
    """A robot: what it moves and senses, how far it may go, and when it stops.

    Attributes:
        path: The file that it was read from.
        name: Name of the robot.
        body: What it is, such as "car".
        control_hz: How many commands a second it expects.
        calibrated: When it was calibrated; None for never.
        actions: The numbers of a command, in order.
        outputs: What they move.
        sensors: What the guard reads.
        camera: Its camera; None without one.
        limits: When it stops by itself.
        max_observation_age_ms: How old an observation may be that a command answers.
        arming: Who may arm it.
        stop: How it stops.
        reward: Weights of the task.
        reset: Commands that bring it back; empty for none.
        enable: The one-shot of the enable line; None without one.
        stop_pin: BCM pin of the emergency stop button; None without one.
    """

    path: Path
    name: str
    body: str
    control_hz: float
    calibrated: datetime.date | None
    actions: tuple[ActionPlan, ...]
    outputs: tuple[OutputPlan, ...]
    sensors: tuple[SensorPlan, ...]
    camera: CameraPlan | None
    limits: LimitPlan
    max_observation_age_ms: int
    arming: Literal["person", "anyone"]
    stop: StopPlan
    reward: RewardPlan
    reset: tuple[ResetStep, ...]
    enable: EnablePlan | None
    stop_pin: int | None

    @property
    def image_size(self) -> tuple[int, int] | None:
        """Width and height of the pictures in pixels; None without a camera."""
        return self.camera.size if self.camera else None

    def guard_plan(self) -> GuardPlan:
        """What the guard needs to know."""
        plan = GuardPlan(
            name=self.name,
            actions=self.actions,
            outputs=self.outputs,
            sensors=self.sensors,
            limits=self.limits,
            stop=self.stop,
            stop_pin=self.stop_pin,
        )
        if self.enable is None:
            return plan
        return dataclasses.replace(
            plan, enable_pin=self.enable.pin, enable_hold_ms=self.enable.hold_ms
        )

    def action_layout(self) -> Layout:
        """What each number of a command means.

        The range is the whole one of the action, whatever the caps of the robot are: these clip,
        and `action_applied` says how much. That of a tendon has a gain in newtons: from its
        pretension, at 0, to the most that it may pull, at 1, which is the highest tension of the
        state.
        """
        spans = tension_spans(self.outputs)
        return Layout(
            tuple(_action_feature(action, spans.get(action.name)) for action in self.actions)
        )

    def state_layout(self) -> Layout:
        """What each number of a state means: what the sensors give, then what the actions do."""
        applied = tuple(
            Feature(
                f"{action.name}/{APPLIED}",
                "1",
                0.0 if action.one_sided else -1.0,
                1.0,
                Element("actuator", action.name),
            )
            for action in self.actions
        )
        return Layout((*state_features(self.sensors, self.actions, self.limits), *applied))

    def reward_weights(self) -> dict[str, float]:
        """The weights of the task by name, as in `Welcome.reward`; a truth is 1 or 0."""
        return {name: float(weight) for name, weight in dataclasses.asdict(self.reward).items()}

    def reset_routine(self) -> tuple[tuple[tuple[float, ...], float], ...]:
        """The values of each step and how many seconds it lasts, as in `Welcome.reset`."""
        return tuple((step.values, step.seconds) for step in self.reset)


def _action_feature(action: ActionPlan, span_n: float | None) -> Feature:
    """What a number of a command means; `span_n` is that of the tendon which it alone pulls, N."""
    unit, factor = _SI.get(action.unit, (action.unit, 1.0))
    if span_n is not None and unit == "1":
        unit, factor = "N", span_n
    return Feature(
        action.name,
        "1",
        0.0 if action.one_sided else -1.0,
        1.0,
        Element("actuator", action.name),
        gain=action.gain * factor,
        gain_unit="" if unit == "1" else unit,
    )
