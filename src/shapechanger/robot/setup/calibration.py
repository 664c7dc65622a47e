"""Calibration of a robot: pulses, motors and wheels, and the zeros of joints and tendons."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Sequence
from contextlib import closing
from typing import Any, Final, Literal

from msgspec.structs import replace

from shapechanger.contract.plan import GuardPlan, OutputPlan
from shapechanger.errors import RobotError, translate_errors
from shapechanger.robot.drivers.as5600 import COUNTS_PER_TURN, As5600
from shapechanger.robot.drivers.chip import OUTPUTS, KeyMistake
from shapechanger.robot.drivers.pulse import pulsed_keys
from shapechanger.robot.drivers.servos.bus import ServoBus
from shapechanger.robot.drivers.servos.settings import DRIVER, BusSettings, bus_settings
from shapechanger.robot.guard.outputs import Switches
from shapechanger.robot.hardware import Hardware

# Widest pulses while a servo is jogged, us, so that it is not driven far against its stop. Makers
# state 500 to 2500 us as the full range of standard servos; most of them reach 900 to 2100 us.
_WIDEST_US: Final = (600, 2400)


def widest_pulses(output: OutputPlan) -> dict[str, int]:
    """Return the settings for the widest pulses of a servo or controller, to jog it."""
    low, _, high = OUTPUTS[output.driver].pulses
    turned = output.settings[low] > output.settings[high]
    return dict(zip((high, low) if turned else (low, high), _WIDEST_US, strict=True))


def reading(output: OutputPlan, value: float) -> str:
    """Describe a servo, controller or motor at a value, -1 to 1, in the unit of its settings."""
    if OUTPUTS[output.driver].pulses:
        return f"{pulsed_keys(output).width_us(value):.0f} µs"
    return f"duty {abs(value) * output.settings['full']:.2f}"


def pulse_changes(output: OutputPlan, found: Sequence[float]) -> dict[str, int]:
    """Return the changes of the profile for a jogged output: pulse widths, us, by dotted name.

    `found` contains the values of the low end, middle and high end, -1 to 1.
    """
    jogged = pulsed_keys(output)
    widths = [round(jogged.width_us(value)) for value in found]
    changes = dict(zip(jogged.widths, widths, strict=True))
    with translate_errors(
        KeyMistake, to=lambda error: RobotError(f"{error.key} of {output.name} {error}.")
    ):
        replace(jogged, **changes)  # Checks the order.
    return {f"output.{output.name}.{key}": us for key, us in changes.items()}


def motor_changes(
    output: OutputPlan, went: Literal["forward", "backward"], starts_at: float
) -> dict[str, Any]:
    """Return the changes of the profile for a motor, keyed by dotted name.

    With a forward command the motor turned in the direction `went`, and it started to turn at a
    duty of `starts_at`, 0 to 1.
    """
    full: float = output.settings["full"]
    if not 0.0 <= starts_at < full:
        raise RobotError(
            f"{output.name} must start at a duty from 0 to below its full duty of {full:g}, got "
            f"{starts_at:g}."
        )
    start: dict[str, Any] = {f"output.{output.name}.start": round(starts_at, 2)}
    mix = {action: -weight for action, weight in output.mix.items()}
    return start if went == "forward" else start | {f"output.{output.name}.mix": mix}


def wheel_changes(sensor: str, wheel_m: float, measured_m: float) -> dict[str, float]:
    """Return the changes of the profile for an encoder, after the robot was pushed forward by 1 m.

    The profile states `wheel_m` per turn. The encoder measured `measured_m`, negative for backward.
    """
    if measured_m <= 0.0:
        raise RobotError(
            f"{sensor} measured {measured_m:g} m for 1 m forward: check its wires, and swap its "
            "pins `a` and `b` if it counts backward."
        )
    return {f"sensor.{sensor}.wheel_m": round(wheel_m / measured_m, 4)}


_START_TICKS: Final = 50  # Half a second: boot time of servos that were just powered.
_READINGS: Final = 50  # Readings that are averaged: single ones differ by a count or two.
# Motion that is ignored: half a percent of the longest excursion of a finger's tendon.
_STILL_M: Final = 0.2e-3
_STILL_MS: Final = 300  # Time for which no servo may move.
_WITHIN_MS: Final = 10_000  # Time limit of homing.
_TRAVEL_M: Final = 0.06  # Most that a tendon may be wound in.


def find_joint_zeros(
    plan: GuardPlan, hardware: Hardware, wait: Callable[[], object]
) -> dict[str, int]:
    """Average the encoder readings while a person holds the joints straight.

    `wait` waits for about 10 ms. The results are counts, 0 to 4095, keyed by sensor and joint, such
    as `joints.MCP_flexion`.
    """
    zeros: dict[str, int] = {}
    counts_per_rad = COUNTS_PER_TURN / (2.0 * math.pi)
    for sensor in (one for one in plan.sensors if one.driver == "as5600"):
        with closing(As5600(sensor, hardware)) as opened:
            for joint in opened.joints:
                # The mean direction, because the mean of counts around 0 would be half a turn.
                mean = 0j
                for _ in range(_READINGS):
                    mean += cmath.exp(1j * opened.counts(joint) / counts_per_rad)
                    wait()
                counts = round(cmath.phase(mean) * counts_per_rad) % COUNTS_PER_TURN
                zeros[f"{sensor.name}.{joint}"] = counts
    return zeros


def require_homing(settings: BusSettings) -> None:
    """Refuse a tension below the gears' measured friction: the tendon would stay slack."""
    for servo in settings.servos:
        pull, friction = servo.homing_n, servo.known.friction_nm / servo.spool_radius_m
        if servo.known.is_measured and pull <= friction:
            raise RobotError(
                f"{servo.label} cannot find its zero with {pull:g} N: its gears hold against "
                f"about {friction:.1f} N. Set homing_n, to {1.5 * friction:.1f} N for example."
            )


def home(bus: ServoBus, cycle: Callable[[], int]) -> dict[str, int]:
    """Pull all tendons until all servos stand still; the finger must be in a known posture.

    This also takes up slack. The servos must have been enabled by `ServoBus.hold`. `cycle` sends
    the requested tensions, runs a cycle, and returns its time, ns. The results are the positions at
    the zeros of the tendons, in counts, keyed by the servos' names.
    """
    servos = {one.settings.name: one for one in bus.servos.values()}
    starts: dict[str, int] = {}
    moved: dict[str, tuple[int, int]] = {}  # Position and time at which each last moved.
    for one in servos.values():
        one.request(one.settings.homing_n)
    began_ns = now_ns = cycle()
    while True:
        if bus.reason:
            raise RobotError(f"No zero: {bus.reason}")
        for name, one in servos.items():
            if one.missed:
                continue
            servo, at = one.settings, one.position
            wound_m = (starts.setdefault(name, at) - at) * servo.metre_per_count
            if wound_m > _TRAVEL_M:
                raise RobotError(
                    f"{servo.label} has no zero: it was wound in by {1e3 * wound_m:.0f} mm without "
                    "resistance. Its tendon has come off."
                )
            was_at, _ = moved.setdefault(name, (at, now_ns))
            if abs((at - was_at) * servo.metre_per_count) > _STILL_M:
                moved[name] = at, now_ns
        still_ns = now_ns - _STILL_MS * 1_000_000
        moving = [name for name in servos if name not in moved or moved[name][1] > still_ns]
        if not moving:
            return {name: one.position for name, one in servos.items()}
        if now_ns - began_ns > _WITHIN_MS * 1_000_000:
            names = ", ".join(moving)
            raise RobotError(f"No zero: {names} still moved after {_WITHIN_MS / 1e3:g} s.")
        now_ns = cycle()


def find_zeros(plan: GuardPlan, hardware: Hardware, wait: Callable[[], object]) -> dict[str, int]:
    """Pull all tendons gently until they stop, release them, and return the zeros; see `home`.

    A person holds the finger straight, and no other process may have the bus open. `wait` waits for
    about 10 ms.
    """
    outputs = [output for output in plan.outputs if output.driver == DRIVER]
    if not outputs:
        raise RobotError(f"{plan.name} has no tendons on a servo bus.")
    settings = bus_settings(outputs)
    require_homing(settings)
    with (
        closing(Switches(plan, hardware)) as switches,
        closing(ServoBus(settings, hardware)) as bus,
    ):

        def cycle() -> int:
            switches.toggle()
            bus.flush(grip=False)
            now_ns = hardware.clock.now_ns()
            bus.cycle(now_ns)
            wait()
            return now_ns

        for _ in range(_START_TICKS if plan.enable_pin is not None else 0):
            switches.toggle()
            wait()
        bus.open()
        bus.set_up(switches.toggle)
        bus.hold()
        return home(bus, cycle)
