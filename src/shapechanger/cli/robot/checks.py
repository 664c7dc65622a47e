"""What a robot is tried with while its wheels are off the ground, over its own link."""

from __future__ import annotations

import math
import os
import signal
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final, Literal

from shapechanger.layout import Layout
from shapechanger.link.messages import Observation
from shapechanger.remote.client import RobotClient
from shapechanger.robot.profile.profile import Profile
from shapechanger.twin.running import RunningRobot

__all__ = ["Check", "check_robot"]

# From the last command until the applied action is at rest, on top of the deadline.
_SLACK_MS: Final = 50.0
_DRIVES_S: Final = 1.0
_COASTS_S: Final = 3.0
_STANDS_MPS: Final = 0.02


@dataclass(frozen=True, slots=True)
class Check:
    """What one check came to.

    Attributes:
        name: What was tried.
        level: "good", "bad", or "unknown" where nothing measures it.
        sentence: What was seen.
    """

    name: str
    level: Literal["good", "bad", "unknown"]
    sentence: str


class _Person:
    """Somebody at the robot's link who drives by hand, and looks at what comes back."""

    def __init__(self, client: RobotClient, profile: Profile, cap: float) -> None:
        self._client = client
        self._state = Layout.from_json(client.welcome.state_layout)
        self._propels = [action.propels for action in profile.actions]
        # Forward alone: a tank's steering propels too, and would make it turn.
        forward = next((i for i, propels in enumerate(self._propels) if propels), None)
        self._forward = [float(i == forward) for i in range(len(self._propels))]
        self._cap = cap

    @property
    def moves(self) -> bool:
        """Whether there is anything that propels."""
        return any(self._forward)

    def look(self) -> Observation:
        """The robot now."""
        newest = self._client.newest
        self._client.acknowledge()
        return self._client.observation(newest.message.seq if newest else 0).message

    def push(self, seconds: float) -> Observation:
        """Drive forward for so long, and say what was seen last."""
        seen = self.look()
        until_s = time.monotonic() + seconds
        while time.monotonic() < until_s:
            self._client.command(self._forward, answers=seen.seq, scale=self._cap)
            seen = self._client.observation(seen.seq).message
        return seen

    def watch(self, done: Callable[[Observation], bool], seconds: float) -> Observation | None:
        """Look until something is seen; None if it is not seen in time."""
        until_s = time.monotonic() + seconds
        while time.monotonic() < until_s:
            if done(seen := self.look()):
                return seen
        return None

    def at_rest(self, seen: Observation) -> bool:
        """Whether nothing propels, as far as the robot says."""
        pairs = zip(self._propels, seen.action_applied, strict=True)
        return not any(propels and value for propels, value in pairs)

    def speed(self, seen: Observation) -> float | None:
        """Speed in m/s where a sensor measures it."""
        if seen.sources.get("speed", "absent") in {"absent", "estimated"}:
            return None
        return dict(zip(self._state.names, seen.state, strict=True)).get("speed")


def check_robot(robot: RunningRobot, profile: Profile, cap: float) -> Iterator[Check]:
    """Try a robot; its wheels must be off the ground.

    Args:
        robot: The robot, served.
        profile: Its profile.
        cap: Largest throttle, 0 to 1.

    Raises:
        LinkError: If it cannot be reached.
    """
    with robot.client(role="person", frames=False, name="selftest") as client:
        person = _Person(client, profile, cap)
        client.take()
        yield _boots_disarmed(person)
        client.arm()
        if not person.moves:
            yield Check("drives", "unknown", "Nothing of this robot propels.")
            return
        yield _drives(person)
        yield _silence(person, profile)
        yield from _coasts(person)
        yield _emergency(client, person)
        client.arm()
        person.push(0.3)
        yield _disarms(client, person)
        client.arm()
        person.push(0.3)
    robot.forget_ready()
    os.kill(robot.pid_of("daemon"), signal.SIGKILL)
    robot.await_restart()
    with robot.client(role="person", frames=False, name="selftest") as client:
        person = _Person(client, profile, cap)
        client.take()
        yield _judged(
            "disarmed after a crash",
            not (seen := person.look()).armed and person.at_rest(seen),
            "The daemon was killed; the robot started afresh and stands still, not armed.",
        )


def _judged(name: str, good: bool, sentence: str) -> Check:
    return Check(name, "good" if good else "bad", sentence)


def _boots_disarmed(person: _Person) -> Check:
    seen = person.push(0.3)
    good = not seen.armed and person.at_rest(seen)
    return _judged("boots disarmed", good, f"Commands before arming: {seen.stop_reason}")


def _drives(person: _Person) -> Check:
    seen = person.push(_DRIVES_S)
    if person.at_rest(seen):
        return Check("drives", "bad", f"It did not drive: {seen.stop_reason}")
    speed = person.speed(seen)
    if speed is None:
        return Check("drives", "unknown", "Outputs moved; nothing measures whether wheels did.")
    words = f"The encoder says {speed:+.2f} m/s for forward."
    return _judged("drives", speed > 0.0, words)


def _silence(person: _Person, profile: Profile) -> Check:
    """Nobody commands any more; how long the outputs go on, by the robot's own clock."""
    before = person.push(0.5)
    told_ns = before.command_ns
    seen = person.watch(person.at_rest, _COASTS_S)
    if seen is None or told_ns is None:
        return Check("stops by silence", "bad", "It did not stop.")
    stopped_ms = (seen.state_ns - told_ns) / 1e6
    limit_ms = profile.limits.deadline_ms + _SLACK_MS + 1e3 / profile.control_hz
    words = f"At rest at most {stopped_ms:.0f} ms after the last command."
    return _judged("stops by silence", stopped_ms <= limit_ms, words)


def _coasts(person: _Person) -> Iterator[Check]:
    """How long the wheels turn on without power."""
    begin_s = time.monotonic()
    if person.speed(person.look()) is None:
        yield Check("wheels stand", "unknown", "No encoder measures the wheels.")
        return
    seen = person.watch(lambda o: abs(person.speed(o) or 0.0) < _STANDS_MPS, _COASTS_S)
    took_s = time.monotonic() - begin_s if seen else math.inf
    yield _judged("wheels stand", seen is not None, f"The wheels stood {took_s:.2f} s later.")


def _emergency(client: RobotClient, person: _Person) -> Check:
    person.push(0.3)
    client.emergency_stop("A self-test.")
    seen = person.watch(lambda o: o.emergency, 1.0)
    after = person.push(0.3) if seen else None
    good = after is not None and after.emergency and person.at_rest(after)
    words = f"Commands after it: {after.stop_reason}" if after else "It was not heard."
    return _judged("emergency stop", good, words)


def _disarms(client: RobotClient, person: _Person) -> Check:
    client.disarm()
    seen = person.watch(lambda o: not o.armed and person.at_rest(o), 1.0)
    words = seen.stop_reason if seen else "It did not."
    return _judged("disarms", seen is not None, words)
