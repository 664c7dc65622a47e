"""Checks of a robot's wiring that move nothing: resistors, buttons, sensors, chips and servos.

They need the pins and buses for themselves, so the robot must not be served meanwhile.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Final, Literal

from shapechanger.errors import RobotError, ShapechangerError
from shapechanger.robot.drivers.errors import device_errors
from shapechanger.robot.drivers.sensor import open_sensor
from shapechanger.robot.drivers.servos.settings import DRIVER, stops_itself
from shapechanger.robot.guard.outputs import OutputBank
from shapechanger.robot.guard.plan import GuardPlan, SensorPlan, driven_pins
from shapechanger.robot.hardware import Hardware

Level = Literal["good", "missing", "unknown"]
Results = Iterator[tuple[Level, str]]

CHECK_S: Final = 10.0
"""Time for each check, s; a bus whose servos are all silent needs the longest, some seconds."""

_MODE1: Final = 0x00  # First register of a PCA9685; reading it changes nothing.
_NO_BATTERY_V: Final = 1.0
_DISTANCE_READS: Final = 5
_PING_NS: Final = 70_000_000  # Longer than the 60 ms from ping to ping of an HC-SR04.


def pull_resistors(guard: GuardPlan, hardware: Hardware) -> Results:
    """Check the resistors that keep outputs off while no program holds their pins.

    Each pin becomes an input with the Pi's own resistor of about 50 kOhm, first up and then down,
    which 10 kOhm outside overrule. A motor could start where they are missing, so its supply must
    be off.

    Args:
        guard: The robot.
        hardware: Its pins.
    """
    for pin, use in driven_pins(guard).items():
        level = _outside_level(pin, hardware)
        if level == 0:
            yield "good", f"GPIO{pin}, {use}, is pulled down."
        elif level == 1:
            words = "something holds it high, and it must be low while no program drives it"
            yield "missing", f"GPIO{pin}, {use}: {words}."
        else:
            yield (
                "missing",
                f"GPIO{pin}, {use}, has no pull-down: fit 10 kOhm to ground, because it may run "
                "while no program holds the pin.",
            )
    for pin in _enables(guard):
        level = _outside_level(pin, hardware)
        if level == 1:
            yield "good", f"GPIO{pin}, OE of the servo board, is pulled up."
        else:
            words = "has no pull-up" if level is None else "is held low"
            yield (
                "missing",
                f"GPIO{pin}, OE of the servo board, {words}: fit 10 kOhm to 3.3 V, or the board "
                "sends pulses while no program holds it.",
            )


def _enables(guard: GuardPlan) -> list[int]:
    """Return the pins at OE of servo boards."""
    boards = [one.settings for one in guard.outputs if one.settings.get("over") == "pca9685"]
    return sorted({one["output_enable"] for one in boards} - {-1})


def _outside_level(pin: int, hardware: Hardware) -> int | None:
    """Return the level that resistors outside give a pin; None if its own resistor decides."""
    up, down = (_level(pin, hardware, pull_up=pull_up) for pull_up in (True, False))
    return up if up == down else None


def _level(pin: int, hardware: Hardware, *, pull_up: bool) -> int:
    """Return the level of a pin with the Pi's own resistor; it floats again afterwards."""
    from gpiozero import InputDevice  # Robots without pins do not need gpiozero.

    with (
        device_errors(f"GPIO{pin}"),
        InputDevice(pin, pull_up=pull_up, pin_factory=hardware.pin_factory()) as device,
    ):
        return int(device.is_active != pull_up)


def emergency_button(guard: GuardPlan, hardware: Hardware) -> Results:
    """Check that the emergency button is released.

    Args:
        guard: The robot.
        hardware: Its pins.
    """
    if guard.stop_pin is None:
        return
    if _level(guard.stop_pin, hardware, pull_up=True):
        words = "is high: released, or not fitted. Hold it down and check again to tell"
        yield "good", f"GPIO{guard.stop_pin} {words}."
    else:
        words = "is low: it is pressed, or its wire touches ground"
        yield "missing", f"GPIO{guard.stop_pin} {words}."


def read_sensor(plan: SensorPlan, guard: GuardPlan, hardware: Hardware) -> Results:
    """Read a sensor once, by its own driver.

    Args:
        plan: The sensor.
        guard: The robot.
        hardware: Its pins and buses.

    Raises:
        RobotError: If it does not respond.
    """
    if plan.measures == "speed":
        pins = [plan.settings[key] for key in ("a", "b") if plan.settings[key] >= 0]
        levels = [
            f"GPIO{pin} is {'high' if _level(pin, hardware, pull_up=True) else 'low'}"
            for pin in pins
        ]
        words = "turn the wheel a little by hand and check again: each must change now and then"
        yield "unknown", f"{plan.name}: {', '.join(levels)}; {words}."
        return
    sensor = open_sensor(plan, hardware)
    try:
        reading = sensor.read(hardware.clock.now_ns(), 0.0)
        for _ in range(_DISTANCE_READS if plan.measures == "distance" else 0):
            if reading:
                break
            hardware.clock.wait([], hardware.clock.now_ns() + _PING_NS, _PING_NS / 1e9)
            reading = sensor.read(hardware.clock.now_ns(), 0.0)
    finally:
        sensor.close()
    yield _judged(plan, reading, guard.limits.low_battery_v)


def _judged(plan: SensorPlan, reading: dict[str, float], low_battery_v: float) -> tuple[Level, str]:
    match plan.measures:
        case "battery":
            volts = reading["battery"]
            if volts < _NO_BATTERY_V:
                return "missing", f"{plan.name} measures {volts:.2f} V: connect its V- to the load."
            if volts < low_battery_v:
                words = f"below low_battery_v, {low_battery_v:g} V: charge the battery"
                return "missing", f"{plan.name} measures {volts:.2f} V, {words}."
            return "good", f"{plan.name} measures {volts:.2f} V."
        case "bump":
            if reading["bump"]:
                return "missing", f"{plan.name} is pressed, or a wire of it is wrong."
            return "good", f"{plan.name} is not pressed."
        case _:
            values = ", ".join(f"{name} {value:.2f}" for name, value in reading.items())
            return "good" if values else "unknown", f"{plan.name}: {values or 'no value yet'}."


def servo_boards(guard: GuardPlan, hardware: Hardware) -> Results:
    """Check that each PCA9685 answers; its pulses stay as they are.

    Args:
        guard: The robot.
        hardware: Its buses.
    """
    outputs = [one.settings for one in guard.outputs if one.settings.get("over") == "pca9685"]
    for bus, address in sorted({(one["bus"], one["address"]) for one in outputs}):
        name = f"The PCA9685 at 0x{address:02x} on I2C bus {bus}"
        try:
            with device_errors(name):
                opened = hardware.i2c(bus)
                try:
                    opened.read_byte_data(address, _MODE1)
                finally:
                    opened.close()
        except RobotError as error:
            words = f"look at SDA, SCL, 3.3 V and ground, and at `i2cdetect -y {bus}`"
            yield "missing", f"{str(error).rstrip('.')}: {words}."
        else:
            yield "good", f"{name} answers."


def servo_bus(guard: GuardPlan, hardware: Hardware) -> Results:
    """Check that every servo of the bus answers and is the right one, without torque.

    Args:
        guard: The robot.
        hardware: Its bus.

    Raises:
        RobotError: If one does not.
    """
    servos = tuple(output for output in guard.outputs if output.driver == DRIVER)
    if not servos:
        return
    if not all(map(stops_itself, servos)):
        yield "unknown", "Not asked: these servos have power only while the enable line has it."
        return
    bank = OutputBank(replace(guard, outputs=servos), hardware)
    try:
        bank.release()
    finally:
        bank.close(hardware.clock.now_ns())
    yield "good", f"All {len(servos)} servos answer."


def finish_in_time(results: Results, limit_s: float, late: str) -> Results:
    """Yield the results of a check until it ends, fails or is late.

    The check runs in a thread of its own, which is left behind if its driver hangs.

    Args:
        results: The check.
        limit_s: Time for all of it, s.
        late: Sentence if it is late.
    """
    found: SimpleQueue[tuple[Level, str] | Exception | None] = SimpleQueue()

    def run() -> None:
        try:
            for result in results:
                found.put(result)
            found.put(None)
        except Exception as error:  # Of any driver; it becomes a finding.
            found.put(error)

    Thread(target=run, name="check", daemon=True).start()
    until_s = time.monotonic() + limit_s
    while True:
        try:
            result = found.get(timeout=max(0.0, until_s - time.monotonic()))
        except Empty:
            yield "missing", late
            return
        match result:
            case None:
                return
            case ShapechangerError():
                yield "missing", str(result)
                return
            case Exception():
                yield "missing", f"The check fails: {type(result).__name__}: {result}."
                return
            case _:
                yield result


def run_checks(
    checks: Iterable[tuple[str, Results]], limit_s: float
) -> Iterator[tuple[str, Level, str]]:
    """Yield name, level and sentence of each result; no check keeps the next from running.

    Args:
        checks: Names and checks.
        limit_s: Time for each, s.
    """
    for check, results in checks:
        late = f"No answer within {limit_s:g} s: its device or driver hangs. Look at its wires and "
        late += "supply, restart the computer, and check again."
        for level, sentence in finish_in_time(results, limit_s, late):
            yield check, level, sentence


def examine_wiring(
    guard: GuardPlan,
    hardware: Hardware,
    *,
    motors_off: bool,
    has_pins: bool = True,
    has_bus: Callable[[int], bool] = lambda _: True,
    limit_s: float = CHECK_S,
) -> Iterator[tuple[str, Level, str]]:
    """Yield name, level and sentence of each check of the wiring.

    Args:
        guard: The robot, which is not served.
        hardware: Its pins and buses.
        motors_off: Whether the motors have no supply, so that their resistors can be tested.
        has_pins: Whether this machine has pins.
        has_bus: Tells whether it has an I2C bus with that number, which this user may open.
        limit_s: Time for each check, s.
    """
    checks: list[tuple[str, Results]] = []
    if driven_pins(guard) or _enables(guard):
        if has_pins and motors_off:
            checks.append(("resistors", pull_resistors(guard, hardware)))
        else:
            words = "take the motors' supply off, and add --motors-off"
            if not has_pins:
                words = "this computer has no pins"
            yield "resistors", "unknown", f"Not tested: {words}."
    if has_pins:
        checks.append(("emergency button", emergency_button(guard, hardware)))
    on_buses = [one for one in guard.outputs if has_bus(one.settings.get("bus", -1))]
    checks.append(("servo board", servo_boards(replace(guard, outputs=tuple(on_buses)), hardware)))
    for plan in guard.sensors:
        if plan.driver in {"as5600", DRIVER}:  # They have checks of their own.
            continue
        there = has_bus(plan.settings["bus"]) if "bus" in plan.settings else has_pins
        if there or plan.driver == "cpu_temperature":
            checks.append(("sensor", read_sensor(plan, guard, hardware)))
    checks.append(("servo bus", servo_bus(guard, hardware)))
    yield from run_checks(checks, limit_s)
