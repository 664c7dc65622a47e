"""Checks that drive a robot by hand: it moves when told, and stops by every means."""

from __future__ import annotations

import math
import os
import signal
import time
from collections.abc import Callable, Iterator
from typing import Final

from shapechanger.layout import Layout
from shapechanger.robot.check.report import Checks, Finding, Results, judged, run_checks
from shapechanger.robot.link.messages import Observation
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.twin.robot import RunningRobot

# Time from the last command to rest, beyond the deadline.
_SLACK_MS: Final = 50.0
_DRIVES_S: Final = 1.0
_PUSH_S: Final = 0.3
_COASTS_S: Final = 3.0
_HEARD_S: Final = 1.0
_STANDS_MPS: Final = 0.02


class _DrivenRobot:
    """A robot with its wheels off the ground, driven by a person."""

    def __init__(self, robot: RunningRobot, profile: Profile, cap: float) -> None:
        self.robot = robot
        self.profile = profile
        self._propels = [action.propels for action in profile.actions]
        # Forward only: a tank's steering propels too.
        forward = next((i for i, propels in enumerate(self._propels) if propels), None)
        self._forward = [float(i == forward) for i in range(len(self._propels))]
        self._cap = cap
        self.connect()

    def connect(self) -> None:
        """Take control over a new connection."""
        self.client = self.robot.client(role="person", frames=False, name="check")
        self._state = Layout.from_json(self.client.welcome.state_layout).names
        self.client.take()

    @property
    def is_motive(self) -> bool:
        """Whether an action propels it."""
        return any(self._forward)

    def look(self) -> Observation:
        """Return the newest observation."""
        newest = self.client.newest
        self.client.acknowledge()
        return self.client.observation(newest.message.seq if newest else 0).message

    def push(self, seconds: float = _PUSH_S) -> Observation:
        """Drive forward for some seconds and return the last observation."""
        seen = self.look()
        until_s = time.monotonic() + seconds
        while time.monotonic() < until_s:
            self.client.command(self._forward, answers=seen.seq, scale=self._cap)
            seen = self.client.observation(seen.seq).message
        return seen

    def watch(self, done: Callable[[Observation], bool], seconds: float) -> Observation | None:
        """Wait for an observation that satisfies `done`; None on timeout."""
        until_s = time.monotonic() + seconds
        while time.monotonic() < until_s:
            if done(seen := self.look()):
                return seen
        return None

    def at_rest(self, seen: Observation) -> bool:
        """Return whether no applied action propels."""
        pairs = zip(self._propels, seen.action_applied, strict=True)
        return not any(propels and value for propels, value in pairs)

    def speed(self, seen: Observation) -> float | None:
        """Return the measured speed, m/s; None without a sensor."""
        if seen.sources.get("speed", "absent") in {"absent", "estimated"}:
            return None
        return dict(zip(self._state, seen.state, strict=True)).get("speed")


def _stands() -> Results:
    yield "unknown", "Nothing of this robot propels."


def _boots_disarmed(robot: _DrivenRobot) -> Results:
    seen = robot.push()
    good = not seen.armed and robot.at_rest(seen)
    yield judged(good, f"Commands before arming: {seen.stop_reason}")


def _drives(robot: _DrivenRobot) -> Results:
    robot.client.arm()
    seen = robot.push(_DRIVES_S)
    speed = robot.speed(seen)
    if robot.at_rest(seen):
        yield "bad", f"It did not drive: {seen.stop_reason}"
    elif speed is None:
        yield "unknown", "Outputs moved; nothing measures whether wheels did."
    else:
        yield judged(speed > 0.0, f"The encoder says {speed:+.2f} m/s for forward.")


def _silence(robot: _DrivenRobot) -> Results:
    """Stop commanding and measure how long the outputs continue, on the robot's clock."""
    told_ns = robot.push(0.5).command_ns
    seen = robot.watch(robot.at_rest, _COASTS_S)
    if seen is None or told_ns is None:
        yield "bad", "It did not stop."
        return
    stopped_ms = (seen.state_ns - told_ns) / 1e6
    limit_ms = robot.profile.limits.deadline_ms + _SLACK_MS + 1e3 / robot.profile.control_hz
    sentence = f"At rest at most {stopped_ms:.0f} ms after the last command."
    yield judged(stopped_ms <= limit_ms, sentence)


def _coasts(robot: _DrivenRobot) -> Results:
    """Measure how long the wheels coast."""
    if robot.speed(robot.look()) is None:
        yield "unknown", "No encoder measures the wheels."
        return
    begin_s = time.monotonic()
    seen = robot.watch(lambda o: abs(robot.speed(o) or 0.0) < _STANDS_MPS, _COASTS_S)
    took_s = time.monotonic() - begin_s if seen else math.inf
    yield judged(seen is not None, f"The wheels stood {took_s:.2f} s later.")


def _emergency(robot: _DrivenRobot) -> Results:
    robot.push()
    robot.client.emergency_stop("A check.")
    if robot.watch(lambda o: o.emergency, _HEARD_S) is None:
        yield "bad", "It was not heard."
        return
    after = robot.push()
    yield judged(
        after.emergency and robot.at_rest(after), f"Commands after it: {after.stop_reason}"
    )


def _disarms(robot: _DrivenRobot) -> Results:
    robot.client.arm()
    robot.push()
    robot.client.disarm()
    seen = robot.watch(lambda o: not o.armed and robot.at_rest(o), _HEARD_S)
    yield judged(seen is not None, seen.stop_reason if seen else "It did not.")


def _crash(robot: _DrivenRobot) -> Results:
    robot.client.arm()
    robot.push()
    robot.client.close()
    robot.robot.forget_ready()
    os.kill(robot.robot.pid_of("daemon"), signal.SIGKILL)
    robot.robot.await_restart()
    robot.connect()
    seen = robot.look()
    good = not seen.armed and robot.at_rest(seen)
    yield judged(
        good, "The daemon was killed; the robot started afresh and stands still, not armed."
    )


def _checks(robot: _DrivenRobot) -> Checks:
    """Yield the checks, each of which begins with the state that the one before left."""
    motion = {
        "drives": _drives,
        "stops by silence": _silence,
        "wheels stand": _coasts,
        "emergency stop": _emergency,
        "disarms": _disarms,
        "disarmed after a crash": _crash,
    }
    yield "boots disarmed", _boots_disarmed(robot)
    for name, check in motion.items():
        yield name, check(robot) if robot.is_motive else _stands()


def check_driving(robot: RunningRobot, profile: Profile, cap: float) -> Iterator[Finding]:
    """Check a robot with its wheels off the ground.

    Args:
        robot: The running robot.
        profile: Its profile.
        cap: Largest throttle, 0 to 1.
    """
    driven = _DrivenRobot(robot, profile, cap)
    try:
        yield from run_checks(_checks(driven))
    finally:
        driven.client.close()
