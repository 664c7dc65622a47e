"""Checks of a robot's pins: uses, levels, a loopback wire, and LEDs instead of motors."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Final, NamedTuple

from shapechanger.contract.plan import GuardPlan, OutputPlan, SensorPlan, driven_pins
from shapechanger.errors import RobotError
from shapechanger.robot.check.report import Finding
from shapechanger.robot.drivers.chip import OUTPUTS, PULSES, SENSORS, device_errors
from shapechanger.robot.drivers.pins import BCM_OF_BOARD, HIGHEST_BCM
from shapechanger.robot.guard.outputs import Switches
from shapechanger.robot.hardware import Hardware
from shapechanger.robot.setup.install import needs_pins

_TOGGLES: Final = 50
_SETTLES_S: Final = 0.002


def require_pins(plan: GuardPlan) -> None:
    """Refuse a machine without GPIO pins, if the robot's outputs or enable line need some."""
    if needs_pins(plan) and not any(Path("/dev").glob("gpiochip*")):
        raise RobotError(
            f"{plan.name} uses GPIO pins, and this machine has none (no /dev/gpiochip0): "
            "`shapechanger robot serve --twin` runs it on simulated ones."
        )


def _pins_of(plan: GuardPlan) -> dict[int, str]:
    used: dict[int, str] = {}
    for device in (*plan.outputs, *plan.sensors):
        keys = [(SENSORS if isinstance(device, SensorPlan) else OUTPUTS)[device.driver].keys]
        if "over" in device.settings:
            keys.append(PULSES[device.settings["over"]].keys)
        for kind in keys:
            used |= {pin: device.name for _, pin in kind.of(device.settings).connected()}
    if plan.stop_pin is not None:
        used[plan.stop_pin] = "the emergency button"
    return used | driven_pins(plan)


def plan_of_pins(plan: GuardPlan) -> list[str]:
    """Return a line for each pin of a robot, to compare with its wires."""
    positions = {pin: position for position, pin in BCM_OF_BOARD.items()}
    return [
        f"pin          GPIO{pin} ({positions[pin]}): {use}"
        for pin, use in sorted(_pins_of(plan).items())
    ]


def _require_free_pin(pin: int, plan: GuardPlan) -> None:
    if not 0 <= pin <= HIGHEST_BCM:
        raise RobotError(f"The header has the pins GPIO0 to GPIO{HIGHEST_BCM}, got {pin}.")
    if use := _pins_of(plan).get(pin):
        raise RobotError(f"Pin {pin} is used by {use}: join a free pin.")


def probed_pin(plan: GuardPlan, probe: int) -> int:
    """Return the BCM pin to probe, which is low at rest, and driven while a motor runs forward."""
    _require_free_pin(probe, plan)
    for output in plan.outputs:
        weight = output.mix.get("throttle", 0.0)
        if weight and output.driver == "hbridge":
            return int(output.settings["forward" if weight > 0 else "backward"])
        if weight and output.driver == "phase_enable":
            return int(output.settings["enable"])
    raise RobotError("A probe needs a motor on an H-bridge: a servo gets pulses at rest, too.")


def check_jumper(output: int, sensed: int, plan: GuardPlan) -> str:
    """Toggle a pin, check that the pin that is wired to it follows, and describe the result."""
    from gpiozero import DigitalInputDevice, DigitalOutputDevice

    for pin in (output, sensed):
        _require_free_pin(pin, plan)
    if output == sensed:
        raise RobotError(f"A jumper joins two pins, got {output} twice.")
    with (
        closing(Hardware()) as pins,
        DigitalOutputDevice(output, pin_factory=pins.pin_factory()) as driven,
        DigitalInputDevice(sensed, pull_up=False, pin_factory=pins.pin_factory()) as read,
    ):
        for n in range(_TOGGLES):
            driven.value = n % 2
            time.sleep(_SETTLES_S)
            if read.value != n % 2:
                raise RobotError(
                    f"Pin {sensed} does not follow pin {output}: is the wire between them?"
                )
    return f"pin {sensed} followed pin {output} {_TOGGLES} times."


def outside_level(pin: int, hardware: Hardware) -> int | None:
    """Return the level that an external resistor gives a pin; None without such a resistor."""
    up, down = (pin_level(pin, hardware, pull_up=pull_up) for pull_up in (True, False))
    return up if up == down else None


def pin_level(pin: int, hardware: Hardware, *, pull_up: bool) -> int:
    """Return the level of a pin with the Pi's own resistor; the pin floats again afterwards."""
    from gpiozero import InputDevice  # Robots without pins do not need gpiozero.

    with (
        device_errors(f"GPIO{pin}"),
        InputDevice(pin, pull_up=pull_up, pin_factory=hardware.pin_factory()) as device,
    ):
        return int(device.is_active != pull_up)


SHOWN_S: Final = 0.5  # Time for which an LED is lit if no person answers, s.
# Function that asks a person a question; it returns None without an answer.
Ask = Callable[[str], bool | None]


class BenchLamp(NamedTuple):
    """An LED instead of a motor or servo."""

    name: str  # Output and direction, such as "drive forward".
    place: str  # Pin or channel, such as "GPIO22".
    output: OutputPlan | None  # None for the enable line.
    value: float  # Value of the output at which it is lit.
    pin: int | None  # BCM pin; None on a PWM chip.


def lamps_of(plan: GuardPlan) -> list[BenchLamp]:
    """Return the LEDs of a bench: for each output in order, then for the enable line."""
    found: list[BenchLamp] = []
    for output in plan.outputs:
        name, settings, lights = output.name, output.settings, OUTPUTS[output.driver].lights
        if "channel" in settings:
            place = f"channel {settings['channel']} of the {settings['over']}"
            found.append(BenchLamp(f"{name}, dimly", place, output, 1.0, None))
        elif not lights:
            raise RobotError(
                f"Output {name} is a servo on a bus ({output.driver}), which LEDs cannot "
                "replace: use a robot whose outputs are on pins, such as `init car`."
            )
        else:
            pins = [(settings[key], name + end, value) for key, end, value in lights]
            found += [BenchLamp(n, f"GPIO{p}", output, v, p) for p, n, v in pins if p >= 0]
    if (pin := plan.enable_pin) is not None:
        found.append(BenchLamp("enable line", f"GPIO{pin}", None, 1.0, pin))
    return found


def check_lamps(
    plan: GuardPlan,
    connect_pins: Callable[[], Hardware],
    ask: Ask,
    sees: Callable[[BenchLamp], bool | None],
    shown_s: float = SHOWN_S,
) -> Iterator[Finding]:
    """Light each LED alone, ask whether it is lit, and measure it if possible.

    `connect_pins` opens the pins and buses, which no other program may use meanwhile. `sees`
    measures whether an LED is lit, and returns None if it cannot.
    """
    for lamp in lamps_of(plan):
        check = f"LED {lamp.place}"
        try:
            # Opened again for each LED: pins stay claimed until the hardware is closed.
            with closing(connect_pins()) as hardware, _lit(lamp, plan, hardware):
                answer = ask(f"Is the LED on {lamp.place} lit ({lamp.name})?")
                if answer is None:
                    time.sleep(shown_s)
                measured = sees(lamp)
        except RobotError as error:
            yield Finding(check, "bad", f"{lamp.name}: {error}")
            continue
        seen = {True: "lit", False: "NOT lit", None: "not asked"}[answer]
        if measured is not None:
            seen += f", measured as {'lit' if measured else 'NOT lit'}"
        known = {answer, measured} - {None}
        level = "unknown" if not known else "good" if all(known) else "bad"
        yield Finding(check, level, f"{lamp.name}: {seen}.")


@contextmanager
def _lit(lamp: BenchLamp, plan: GuardPlan, hardware: Hardware) -> Generator[None]:
    """Light one LED through the driver of its output, which turns it off when it is closed."""
    if lamp.output is None:
        with closing(Switches(plan, hardware)) as switches:
            switches.toggle()  # From low to high.
            yield
        return
    with closing(OUTPUTS[lamp.output.driver].open(lamp.output, hardware)) as driver:
        driver.write(lamp.value, hardware.clock.now_ns())
        yield
