"""Checks of a robot that runs, and of a pair of free pins."""

from __future__ import annotations

import math
import os
import signal
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal

from shapechanger.errors import RobotError
from shapechanger.layout import Layout
from shapechanger.link.messages import Observation
from shapechanger.robot.guard.plan import GuardPlan, driven_pins
from shapechanger.robot.hardware import Hardware, RealHardware
from shapechanger.robot.profile.profile import Profile

if TYPE_CHECKING:
    from shapechanger.remote.client import RobotClient
    from shapechanger.twin.robot import RunningRobot

# Time from the last command to rest, beyond the deadline.
_SLACK_MS: Final = 50.0
_DRIVES_S: Final = 1.0
_COASTS_S: Final = 3.0
_STANDS_MPS: Final = 0.02


@dataclass(frozen=True, slots=True)
class SelftestResult:
    """Result of one check.

    Attributes:
        name: Name of the check.
        level: "good", "bad", or "unknown" if it cannot be measured.
        sentence: The observation.
    """

    name: str
    level: Literal["good", "bad", "unknown"]
    sentence: str


class _Person:
    """Client that drives by hand and watches the observations."""

    def __init__(self, client: RobotClient, profile: Profile, cap: float) -> None:
        self._client = client
        self._state = Layout.from_json(client.welcome.state_layout)
        self._propels = [action.propels for action in profile.actions]
        # Forward only: a tank's steering propels too.
        forward = next((i for i, propels in enumerate(self._propels) if propels), None)
        self._forward = [float(i == forward) for i in range(len(self._propels))]
        self._cap = cap

    @property
    def moves(self) -> bool:
        """Return whether an action propels the robot."""
        return any(self._forward)

    def look(self) -> Observation:
        """Return the newest observation."""
        newest = self._client.newest
        self._client.acknowledge()
        return self._client.observation(newest.message.seq if newest else 0).message

    def push(self, seconds: float) -> Observation:
        """Drive forward for some seconds and return the last observation."""
        seen = self.look()
        until_s = time.monotonic() + seconds
        while time.monotonic() < until_s:
            self._client.command(self._forward, answers=seen.seq, scale=self._cap)
            seen = self._client.observation(seen.seq).message
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
        return dict(zip(self._state.names, seen.state, strict=True)).get("speed")


def check_robot(robot: RunningRobot, profile: Profile, cap: float) -> Iterator[SelftestResult]:
    """Check a robot with its wheels off the ground.

    Args:
        robot: The running robot.
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
            yield SelftestResult("drives", "unknown", "Nothing of this robot propels.")
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


def _judged(name: str, good: bool, sentence: str) -> SelftestResult:
    return SelftestResult(name, "good" if good else "bad", sentence)


def _boots_disarmed(person: _Person) -> SelftestResult:
    seen = person.push(0.3)
    good = not seen.armed and person.at_rest(seen)
    return _judged("boots disarmed", good, f"Commands before arming: {seen.stop_reason}")


def _drives(person: _Person) -> SelftestResult:
    seen = person.push(_DRIVES_S)
    if person.at_rest(seen):
        return SelftestResult("drives", "bad", f"It did not drive: {seen.stop_reason}")
    speed = person.speed(seen)
    if speed is None:
        return SelftestResult(
            "drives", "unknown", "Outputs moved; nothing measures whether wheels did."
        )
    words = f"The encoder says {speed:+.2f} m/s for forward."
    return _judged("drives", speed > 0.0, words)


def _silence(person: _Person, profile: Profile) -> SelftestResult:
    """Stop commanding and measure how long the outputs continue, on the robot's clock."""
    before = person.push(0.5)
    told_ns = before.command_ns
    seen = person.watch(person.at_rest, _COASTS_S)
    if seen is None or told_ns is None:
        return SelftestResult("stops by silence", "bad", "It did not stop.")
    stopped_ms = (seen.state_ns - told_ns) / 1e6
    limit_ms = profile.limits.deadline_ms + _SLACK_MS + 1e3 / profile.control_hz
    words = f"At rest at most {stopped_ms:.0f} ms after the last command."
    return _judged("stops by silence", stopped_ms <= limit_ms, words)


def _coasts(person: _Person) -> Iterator[SelftestResult]:
    """Measure how long the wheels coast."""
    begin_s = time.monotonic()
    if person.speed(person.look()) is None:
        yield SelftestResult("wheels stand", "unknown", "No encoder measures the wheels.")
        return
    seen = person.watch(lambda o: abs(person.speed(o) or 0.0) < _STANDS_MPS, _COASTS_S)
    took_s = time.monotonic() - begin_s if seen else math.inf
    yield _judged("wheels stand", seen is not None, f"The wheels stood {took_s:.2f} s later.")


def _emergency(client: RobotClient, person: _Person) -> SelftestResult:
    person.push(0.3)
    client.emergency_stop("A self-test.")
    seen = person.watch(lambda o: o.emergency, 1.0)
    after = person.push(0.3) if seen else None
    good = after is not None and after.emergency and person.at_rest(after)
    words = f"Commands after it: {after.stop_reason}" if after else "It was not heard."
    return _judged("emergency stop", good, words)


def _disarms(client: RobotClient, person: _Person) -> SelftestResult:
    client.disarm()
    seen = person.watch(lambda o: not o.armed and person.at_rest(o), 1.0)
    words = seen.stop_reason if seen else "It did not."
    return _judged("disarms", seen is not None, words)


_TOGGLES: Final = 50
_SETTLES_S: Final = 0.002


def check_jumper(
    output: int, sensed: int, plan: GuardPlan, hardware: Hardware | None = None
) -> str:
    """Toggle an output and check the input that is wired to it.

    Args:
        output: BCM pin to drive, unused by the robot.
        sensed: BCM pin to read, unused by the robot.
        plan: The robot.
        hardware: Its pins; those of this machine by default.

    Returns:
        Description of the result.

    Raises:
        RobotError: If the robot uses a pin, or the input does not follow.
    """
    from gpiozero import DigitalInputDevice, DigitalOutputDevice

    for pin in (output, sensed):
        require_free_pin(pin, plan)
    if output == sensed:
        raise RobotError(f"A jumper joins two pins, got {output} twice.")
    pins = hardware or RealHardware()
    try:
        factory = pins.pin_factory()
        with (
            DigitalOutputDevice(output, pin_factory=factory) as driven,
            DigitalInputDevice(sensed, pull_up=False, pin_factory=factory) as read,
        ):
            for n in range(_TOGGLES):
                driven.value = n % 2
                time.sleep(_SETTLES_S)
                if read.value != n % 2:
                    raise RobotError(
                        f"Pin {sensed} does not follow pin {output}: is the wire between them?"
                    )
    finally:
        if hardware is None:
            pins.close()
    return f"pin {sensed} followed pin {output} {_TOGGLES} times."


_LAST_PIN: Final = 27  # BCM number; of the header, GPIO0 to GPIO27.


def require_free_pin(pin: int, plan: GuardPlan) -> None:
    """Refuse a pin that the header lacks, or that the robot uses.

    Args:
        pin: BCM number.
        plan: The robot.

    Raises:
        RobotError: If it is one of these.
    """
    if not 0 <= pin <= _LAST_PIN:
        raise RobotError(f"The header has the pins GPIO0 to GPIO{_LAST_PIN}, got {pin}.")
    if use := pins_of(plan).get(pin):
        raise RobotError(f"Pin {pin} is used by {use}: join a free pin.")


def pins_of(plan: GuardPlan) -> dict[int, str]:
    """Return the robot's pins and their uses."""
    used = driven_pins(plan)
    if plan.stop_pin is not None:
        used[plan.stop_pin] = "the emergency button"
    for device in (*plan.outputs, *plan.sensors):
        pins = [device.settings.get(key, -1) for key in ("output_enable", "a", "b")]
        pins += [device.settings.get(key, -1) for key in ("trigger", "echo")]
        pins += device.settings.get("pins", [])
        used |= {pin: device.name for pin in pins if pin >= 0}
    return used
