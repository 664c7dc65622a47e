"""Checks that drive a robot by hand: it moves when told, and stops by every means."""

from __future__ import annotations

import math
import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from typing import Final

from shapechanger.layout import Layout
from shapechanger.robot.check.report import Finding, judged
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

    def close(self) -> None:
        """Leave the robot."""
        self.client.close()

    def push(self, seconds: float = _PUSH_S) -> Observation:
        """Drive forward for some seconds and return the last observation."""
        seen = self.client.ask().message
        until_s = time.monotonic() + seconds
        while time.monotonic() < until_s:
            self.client.command(self._forward, answers=seen.seq, scale=self._cap)
            seen = self.client.observation(seen.seq).message
        return seen

    def watch(self, done: Callable[[Observation], bool], seconds: float) -> Observation | None:
        """Wait for an observation that satisfies `done`; None on timeout."""
        until_s = time.monotonic() + seconds
        while time.monotonic() < until_s:
            if done(seen := self.client.ask().message):
                return seen
        return None

    def at_rest(self, seen: Observation) -> bool:
        """Return whether no applied action propels."""
        pairs = zip(self._propels, seen.action_applied, strict=True)
        return not any(propels and value for propels, value in pairs)

    def stands(self, seen: Observation) -> bool:
        """Return whether it is at rest and not armed."""
        return self.at_rest(seen) and not seen.armed

    def speed(self, seen: Observation) -> float | None:
        """Return the measured speed, m/s; None without a sensor."""
        if seen.sources.get("speed", "absent") in {"absent", "estimated"}:
            return None
        return dict(zip(self._state, seen.state, strict=True)).get("speed")


def check_driving(robot: RunningRobot, profile: Profile, cap: float) -> Iterator[Finding]:
    """Check a robot with its wheels off the ground.

    Each check begins with the state that the one before left.

    Args:
        robot: The running robot.
        profile: Its profile.
        cap: Largest throttle, 0 to 1.
    """
    with closing(_DrivenRobot(robot, profile, cap)) as driven:
        seen = driven.push()
        sentence = f"Commands before arming: {seen.stop_reason}"
        yield Finding("boots disarmed", *judged(driven.stands(seen), sentence))
        if any(action.propels for action in profile.actions):
            yield from _moves(driven)
            limit_ms = profile.limits.deadline_ms + _SLACK_MS + 1e3 / profile.control_hz
            yield from _stops(driven, limit_ms)
        else:
            yield Finding("drives", "unknown", "Nothing of this robot propels.")


def _moves(driven: _DrivenRobot) -> Iterator[Finding]:
    driven.client.arm()
    seen = driven.push(_DRIVES_S)
    speed = driven.speed(seen)
    if driven.at_rest(seen):
        yield Finding("drives", "bad", f"It did not drive: {seen.stop_reason}")
    elif speed is None:
        yield Finding("drives", "unknown", "Outputs moved; nothing measures whether wheels did.")
    else:
        sentence = f"The encoder says {speed:+.2f} m/s for forward."
        yield Finding("drives", *judged(speed > 0.0, sentence))


def _stops(driven: _DrivenRobot, limit_ms: float) -> Iterator[Finding]:
    # The time without a command is measured on the robot's clock.
    told_ns = driven.push(0.5).command_ns
    seen = driven.watch(driven.at_rest, _COASTS_S)
    stopped_ms = (seen.state_ns - told_ns) / 1e6 if seen and told_ns else math.inf
    sentence = f"At rest at most {stopped_ms:.0f} ms after the last command."
    if math.isinf(stopped_ms):
        sentence = "It did not stop."
    yield Finding("stops by silence", *judged(stopped_ms <= limit_ms, sentence))

    if driven.speed(driven.client.ask().message) is None:
        yield Finding("wheels stand", "unknown", "No encoder measures the wheels.")
    else:
        begin_s = time.monotonic()
        seen = driven.watch(lambda o: abs(driven.speed(o) or 0.0) < _STANDS_MPS, _COASTS_S)
        took_s = time.monotonic() - begin_s if seen else math.inf
        yield Finding(
            "wheels stand", *judged(bool(seen), f"The wheels stood {took_s:.2f} s later.")
        )

    driven.push()
    driven.client.emergency_stop("A check.")
    if driven.watch(lambda o: o.emergency, _HEARD_S) is None:
        yield Finding("emergency stop", "bad", "It was not heard.")
    else:
        seen = driven.push()
        good = seen.emergency and driven.at_rest(seen)
        yield Finding("emergency stop", *judged(good, f"Commands after it: {seen.stop_reason}"))

    driven.client.arm()
    driven.push()
    driven.client.disarm()
    seen = driven.watch(driven.stands, _HEARD_S)
    yield Finding("disarms", *judged(bool(seen), seen.stop_reason if seen else "It did not."))

    driven.client.arm()
    driven.push()
    driven.client.close()
    driven.robot.forget_ready()
    os.kill(driven.robot.pid_of("daemon"), signal.SIGKILL)
    driven.robot.await_restart()
    driven.connect()
    sentence = "The daemon was killed; the robot started afresh and stands still, not armed."
    good = driven.stands(driven.client.ask().message)
    yield Finding("disarmed after a crash", *judged(good, sentence))
