"""Checks that drive a robot: it must obey, and stop after silence, stop commands and a crash."""

from __future__ import annotations

import math
import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Final

from shapechanger.layout import Layout
from shapechanger.robot.check.report import Finding, judged
from shapechanger.robot.client.client import RobotClient
from shapechanger.robot.link.messages import Observation
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.twin.robot import RunningRobot

# Tolerance, ms, of the time from the last command to rest, beyond the deadline and a period.
_SLACK_MS: Final = 50.0
_DRIVES_S: Final = 1.0
_PUSH_S: Final = 0.3
_COASTS_S: Final = 3.0
_HEARD_S: Final = 1.0
_STANDS_MPS: Final = 0.02


def check_driving(robot: RunningRobot, profile: Profile, cap: float) -> Iterator[Finding]:
    """Check a robot with its wheels off the ground, at a throttle of at most `cap`, 0 to 1.

    Each check begins in the state after the previous one.
    """
    propels = [action.propels for action in profile.actions]
    # Command only the first action that propels, because a tank's steering propels too.
    first = propels.index(True) if any(propels) else -1
    forward = [float(i == first) for i in range(len(propels))]

    def connect() -> RobotClient:
        client = opened.enter_context(robot.client(role="person", frames=False, name="check"))
        client.take()
        return client

    def push(seconds: float = _PUSH_S) -> Observation:
        """Drive forward for some seconds and return the last observation."""
        seen = client.ask().message
        until_s = time.monotonic() + seconds
        while time.monotonic() < until_s:
            client.command(forward, answers=seen.seq, scale=cap)
            seen = client.observation(seen.seq).message
        return seen

    def watch(done: Callable[[Observation], bool]) -> Observation | None:
        """Return the first observation that satisfies `done`, or None after the time limit."""
        until_s = time.monotonic() + _COASTS_S
        while time.monotonic() < until_s:
            if done(seen := client.ask().message):
                return seen
        return None

    def at_rest(seen: Observation) -> bool:
        pairs = zip(propels, seen.action_applied, strict=True)
        return not any(driven and value for driven, value in pairs)

    def stands(seen: Observation) -> bool:
        return at_rest(seen) and not seen.armed

    def speed_of(seen: Observation) -> float | None:
        """Return the measured speed, m/s, or None if no sensor measures it."""
        if seen.sources.get("speed", "absent") in {"absent", "estimated"}:
            return None
        names = Layout.from_json(client.welcome.state_layout).names
        return dict(zip(names, seen.state, strict=True)).get("speed")

    with ExitStack() as opened:
        client = connect()
        seen = push()
        sentence = f"Commands before arming: {seen.stop_reason}"
        yield Finding("boots disarmed", *judged(stands(seen), sentence))
        if not any(propels):
            yield Finding("drives", "unknown", "This robot has no propulsion.")
            return

        client.arm()
        seen = push(_DRIVES_S)
        speed = speed_of(seen)
        if at_rest(seen):
            yield Finding("drives", "bad", f"It did not drive: {seen.stop_reason}")
        elif speed is None:
            sentence = "Outputs moved; without an encoder, it is unknown whether the wheels did."
            yield Finding("drives", "unknown", sentence)
        else:
            sentence = f"The encoder measures {speed:+.2f} m/s for forward."
            yield Finding("drives", *judged(speed > 0.0, sentence))

        # The time without a command is measured on the robot's clock.
        told_ns = push(0.5).command_ns
        rests = watch(at_rest)
        stopped_ms = (rests.state_ns - told_ns) / 1e6 if rests and told_ns else math.inf
        limit_ms = profile.limits.deadline_ms + _SLACK_MS + 1e3 / profile.control_hz
        sentence = f"At rest at most {stopped_ms:.0f} ms after the last command."
        if math.isinf(stopped_ms):
            sentence = "It did not stop."
        yield Finding("stops by silence", *judged(stopped_ms <= limit_ms, sentence))

        if speed_of(client.ask().message) is None:
            yield Finding("wheels stand", "unknown", "No encoder measures the wheels.")
        else:
            begin_s = time.monotonic()
            rests = watch(lambda o: abs(speed_of(o) or 0.0) < _STANDS_MPS)
            took_s = time.monotonic() - begin_s if rests else math.inf
            sentence = f"The wheels stood {took_s:.2f} s later."
            yield Finding("wheels stand", *judged(bool(rests), sentence))

        def crash() -> None:
            nonlocal client
            client.close()
            robot.forget_ready()
            os.kill(robot.pid_of("daemon"), signal.SIGKILL)
            robot.await_restart()
            client = connect()

        stops: dict[str, Callable[[], object]] = {
            "emergency stop": lambda: client.emergency_stop("A check."),
            "disarms": lambda: client.disarm(),
            "disarmed after a crash": crash,
        }
        for name, stop in stops.items():
            client.arm()
            push()
            stop()
            seen = push(_HEARD_S)
            good = stands(seen) and (seen.emergency or name != "emergency stop")
            yield Finding(name, *judged(good, f"Commands after it: {seen.stop_reason}"))
