"""LEDs in place of the motors and servos of a robot, on a bench of one Raspberry Pi."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterator
from contextlib import closing, contextmanager
from typing import Final, NamedTuple

from shapechanger.contract.plan import GuardPlan, OutputPlan
from shapechanger.errors import RobotError
from shapechanger.robot.check.check import Finding, judged
from shapechanger.robot.drivers.chip import open_output
from shapechanger.robot.guard.outputs import enable_device
from shapechanger.robot.hardware import Hardware

SHOWN_S: Final = 0.5
"""Time for which an LED is lit when nobody is asked, s."""

Ask = Callable[[str], bool | None]
"""Asks a person a question; None if nobody answers."""


class BenchLamp(NamedTuple):
    """An LED in place of a motor or servo.

    Attributes:
        name: Its output and direction, such as "drive forward".
        place: Its pin or channel, such as "GPIO22".
        output: The output; None for the enable line.
        value: Value of the output at which it is lit.
        pin: Its BCM pin; None on a PWM chip.
    """

    name: str
    place: str
    output: OutputPlan | None
    value: float = 1.0
    pin: int | None = None


def lamps_of(plan: GuardPlan) -> list[BenchLamp]:
    """Return the LEDs of a bench, in the order of the outputs.

    Args:
        plan: The robot.

    Raises:
        RobotError: If an output takes no LED.
    """
    found: list[BenchLamp] = []

    def add(name: str, pin: int | None, output: OutputPlan | None, value: float = 1.0) -> None:
        if pin is not None and pin >= 0:
            found.append(BenchLamp(name, f"GPIO{pin}", output, value, pin))

    for output in plan.outputs:
        settings, name = output.settings, output.name
        match output.driver:
            case "hbridge":
                for way, value in (("forward", 1.0), ("backward", -1.0), ("enable", 1.0)):
                    add(f"{name} {way}", settings[way], output, value)
            case "phase_enable":
                add(f"{name} enable", settings["enable"], output)
                add(f"{name} backward", settings["phase"], output, -1.0)
            case "servo" | "esc" if settings["over"] == "lgpio":
                add(f"{name}, dimly", settings["pin"], output)
            case "servo" | "esc":
                place = f"channel {settings['channel']} of the {settings['over']}"
                found.append(BenchLamp(f"{name}, dimly", place, output))
            case driver:
                raise RobotError(
                    f"Output {name} is a servo on a bus ({driver}), and an LED cannot stand for "
                    "it: take a robot whose outputs are on pins, such as `init car`."
                )
    add("enable line", plan.enable_pin, None)
    return found


@contextmanager
def lit(lamp: BenchLamp, hardware: Hardware) -> Generator[None]:
    """Light one LED, through the driver of its output, and put it out at the end.

    Args:
        lamp: The LED.
        hardware: Its pins and buses.

    Raises:
        RobotError: If a device does not respond.
    """
    if lamp.output is None:
        device = enable_device(lamp.pin or 0, hardware)
        try:
            device.on()
            yield
        finally:
            device.off()
            device.close()
        return
    with closing(open_output(lamp.output, hardware)) as driver:
        driver.write(lamp.value, hardware.clock.now_ns())
        yield
        driver.write(0.0, hardware.clock.now_ns())


def walk(
    plan: GuardPlan,
    connect_pins: Callable[[], Hardware],
    ask: Ask,
    sees: Callable[[BenchLamp], bool | None],
    shown_s: float = SHOWN_S,
) -> Iterator[Finding]:
    """Light each LED alone, and ask or measure whether it is lit.

    Args:
        plan: The robot.
        connect_pins: Opens its pins and buses, which nothing else uses meanwhile.
        ask: Asks the person.
        sees: Measures whether an LED is lit; None if it cannot.
        shown_s: Time for which an LED is lit when nobody answers, s.
    """
    for lamp in lamps_of(plan):
        name = f"LED {lamp.place}"
        hardware = connect_pins()  # Afresh, because a closed output stays claimed.
        try:
            with lit(lamp, hardware):
                answer = ask(f"Is the LED on {lamp.place} lit ({lamp.name})?")
                if answer is None:
                    time.sleep(shown_s)
                measured = sees(lamp)
        except RobotError as error:
            yield Finding(name, "bad", f"{lamp.name}: {error}")
            continue
        finally:
            hardware.close()
        words = {True: "lit", False: "NOT lit", None: "not asked"}[answer]
        if measured is not None:
            words += f", measured as {'lit' if measured else 'NOT lit'}"
        if answer is None and measured is None:
            yield Finding(name, "unknown", f"{lamp.name}: {words}.")
        else:
            yield Finding(name, *judged(False not in (answer, measured), f"{lamp.name}: {words}."))
