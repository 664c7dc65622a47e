"""Checks of a robot's wiring that move nothing: resistors, buttons, sensors, chips and servos.

They need the pins and buses for themselves, so the robot must not be served meanwhile.
"""

from __future__ import annotations

import importlib.util
import os
import socket
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Final

from shapechanger.contract.plan import GuardPlan, SensorPlan, driven_pins
from shapechanger.errors import RobotError
from shapechanger.robot.cameras.camera import Camera, CameraPlan, open_camera
from shapechanger.robot.check.check import CHECK_S, Check, Level, Results, judged
from shapechanger.robot.drivers.chip import open_sensor
from shapechanger.robot.drivers.errors import device_errors
from shapechanger.robot.drivers.servos.settings import DRIVER, stops_itself
from shapechanger.robot.guard.outputs import OutputBank
from shapechanger.robot.hardware import Hardware
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.raspberry_pi import RealHardware

if TYPE_CHECKING:  # The drivers need gpiozero, which may be missing.
    from shapechanger.robot.drivers.as5600 import As5600, JointEncoder


@dataclass(frozen=True)
class StandingRobot:
    """A robot that is not driven.

    Attributes:
        guard: Outputs, sensors and limits of the robot.
        camera: Its camera, or None.
        port: Port of its server.
        root: Root of the file system.
        look: Opens the camera.
        unit_of: The profile that its systemd unit must name; None to skip the name.
        hardware: Opens its pins and buses.
        motors_off: Whether the motors have no supply, so that their resistors can be tested.
        limit_s: Time for each check, s.
        installed: Whether it is installed on its computer, and not on a bench with LEDs.
        on_twin: Whether it is a twin, whose computer has all pins and buses and no settings.
        profile: The profile, for checks of it and of its credentials; None for neither.
        credentials: Folder of its key and certificate; None for that of `init`.
    """

    guard: GuardPlan
    camera: CameraPlan | None = None
    port: int = 0
    root: Path = Path("/")
    look: Callable[[CameraPlan], Camera] = open_camera
    unit_of: Path | None = None
    hardware: Callable[[], Hardware] = RealHardware
    motors_off: bool = False
    limit_s: float = CHECK_S
    installed: bool = True
    on_twin: bool = False
    profile: Profile | None = None
    credentials: Path | None = None

    @cached_property
    def pins(self) -> Hardware:
        """Its pins and buses, opened once."""
        return self.hardware()

    @cached_property
    def port_error(self) -> str:
        """Why its port cannot be used; "" if it can."""
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind(("", self.port))
            except OSError as error:
                return f"{error.strerror}"
        return ""

    @property
    def has_pins(self) -> bool:
        """Whether its computer has pins."""
        return self.on_twin or any((self.root / "dev").glob("gpiochip*"))

    def has_bus(self, bus: int) -> bool:
        """Return whether this user may open an I2C bus."""
        return self.on_twin or os.access(self.root / f"dev/i2c-{bus}", os.R_OK | os.W_OK)

    def can_read(self, sensor: SensorPlan) -> bool:
        """Return whether what a sensor is wired to is there."""
        if "bus" in sensor.settings:
            return self.has_bus(sensor.settings["bus"])
        return self.has_pins or sensor.driver == "cpu_temperature"

    @property
    def is_free(self) -> bool:
        """Whether its pins and buses can be opened; where it is served, its guard has them."""
        return not self.port_error and importlib.util.find_spec("gpiozero") is not None


def servo_enables(guard: GuardPlan) -> list[int]:
    """Return the pins at OE of servo boards."""
    boards = [one.settings for one in guard.outputs if one.settings.get("over") == "pca9685"]
    return sorted({one["output_enable"] for one in boards} - {-1})


_MODE1: Final = 0x00  # First register of a PCA9685; reading it changes nothing.
_NO_BATTERY_V: Final = 1.0
_DISTANCE_READS: Final = 5
_PING_NS: Final = 70_000_000  # Longer than the 60 ms from ping to ping of an HC-SR04.


def _resistors(robot: StandingRobot) -> Results:
    """Check the resistors that keep outputs off while no program holds their pins.

    Each pin becomes an input with the Pi's own resistor of about 50 kOhm, first up and then down,
    which 10 kOhm outside overrule. A motor could start where they are missing, so its supply must
    be off.
    """
    if not (robot.has_pins and robot.motors_off):
        lacks = "take the motors' supply off, and add --motors-off"
        yield "unknown", f"Not tested: {lacks if robot.has_pins else 'this computer has no pins'}."
        return
    for pin, use in driven_pins(robot.guard).items():
        level = _outside_level(pin, robot.pins)
        if level == 0:
            yield "good", f"GPIO{pin}, {use}, is pulled down."
        elif level == 1:
            words = "something holds it high, and it must be low while no program drives it"
            yield "bad", f"GPIO{pin}, {use}: {words}."
        else:
            yield (
                "bad",
                f"GPIO{pin}, {use}, has no pull-down: fit 10 kOhm to ground, because it may run "
                "while no program holds the pin.",
            )
    for pin in servo_enables(robot.guard):
        level = _outside_level(pin, robot.pins)
        if level == 1:
            yield "good", f"GPIO{pin}, OE of the servo board, is pulled up."
        else:
            words = "has no pull-up" if level is None else "is held low"
            yield (
                "bad",
                f"GPIO{pin}, OE of the servo board, {words}: fit 10 kOhm to 3.3 V, or the board "
                "sends pulses while no program holds it.",
            )


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


def _button(robot: StandingRobot) -> Results:
    """Check that the emergency button is released."""
    pin = robot.guard.stop_pin
    if pin is None:
        return
    if _level(pin, robot.pins, pull_up=True):
        words = "is high: released, or not fitted. Hold it down and check again to tell"
        yield "good", f"GPIO{pin} {words}."
    else:
        yield "bad", f"GPIO{pin} is low: it is pressed, or its wire touches ground."


def _read_sensor(robot: StandingRobot, plan: SensorPlan) -> Results:
    """Read a sensor once, by its own driver."""
    hardware = robot.pins
    if plan.measures == "speed":
        pins = [plan.settings[key] for key in ("a", "b") if plan.settings[key] >= 0]
        levels = [
            f"GPIO{pin} is {'high' if _level(pin, hardware, pull_up=True) else 'low'}"
            for pin in pins
        ]
        words = "turn the wheel a little by hand and check again: each must change now and then"
        yield "unknown", f"{plan.name}: {', '.join(levels)}; {words}."
        return
    with closing(open_sensor(plan, hardware)) as sensor:
        reading = sensor.read(hardware.clock.now_ns(), 0.0)
        for _ in range(_DISTANCE_READS if plan.measures == "distance" else 0):
            if reading:
                break
            hardware.clock.wait([], hardware.clock.now_ns() + _PING_NS, _PING_NS / 1e9)
            reading = sensor.read(hardware.clock.now_ns(), 0.0)
    yield _judged(plan, reading, robot.guard.limits.low_battery_v)


def _judged(plan: SensorPlan, reading: dict[str, float], low_battery_v: float) -> tuple[Level, str]:
    match plan.measures:
        case "battery":
            volts = reading["battery"]
            if volts < _NO_BATTERY_V:
                return "bad", f"{plan.name} measures {volts:.2f} V: connect its V- to the load."
            if volts < low_battery_v:
                words = f"below low_battery_v, {low_battery_v:g} V: charge the battery"
                return "bad", f"{plan.name} measures {volts:.2f} V, {words}."
            return "good", f"{plan.name} measures {volts:.2f} V."
        case "bump":
            words = "pressed, or a wire of it is wrong" if reading["bump"] else "not pressed"
            return judged(not reading["bump"], f"{plan.name} is {words}.")
        case _:
            values = ", ".join(f"{name} {value:.2f}" for name, value in reading.items())
            return "good" if values else "unknown", f"{plan.name}: {values or 'no value yet'}."


def _servo_boards(robot: StandingRobot) -> Results:
    """Check that each PCA9685 answers; its pulses stay as they are."""
    outputs = [one.settings for one in robot.guard.outputs if one.settings.get("over") == "pca9685"]
    boards = {(one["bus"], one["address"]) for one in outputs if robot.has_bus(one["bus"])}
    for bus, address in sorted(boards):
        name = f"The PCA9685 at 0x{address:02x} on I2C bus {bus}"
        try:
            with device_errors(name), closing(robot.pins.i2c(bus)) as opened:
                opened.read_byte_data(address, _MODE1)
        except RobotError as error:
            words = f"look at SDA, SCL, 3.3 V and ground, and at `i2cdetect -y {bus}`"
            yield "bad", f"{str(error).rstrip('.')}: {words}."
        else:
            yield "good", f"{name} answers."


def _servo_bus(robot: StandingRobot) -> Results:
    """Check that every servo of the bus answers and is the right one, without torque."""
    servos = tuple(output for output in robot.guard.outputs if output.driver == DRIVER)
    if not servos:
        return
    if not all(map(stops_itself, servos)):
        yield "unknown", "Not asked: these servos have power only while the enable line has it."
        return
    bank = OutputBank(replace(robot.guard, outputs=servos), robot.pins)
    try:
        bank.release()
    finally:
        bank.close(robot.pins.clock.now_ns())
    yield "good", f"All {len(servos)} servos answer."


def _encoders(robot: StandingRobot) -> Results:
    """Check the magnets of the encoders at the joints, where their bus can be opened."""
    from shapechanger.robot.drivers.as5600 import connect_encoders

    for plan in robot.guard.sensors:
        if plan.driver != "as5600" or not robot.can_read(plan):
            continue
        try:
            with closing(connect_encoders(plan, robot.pins)) as sensor:
                for encoder in sensor.encoders:
                    yield _encoder(sensor, encoder)
        except RobotError as error:
            yield "bad", str(error)


def _encoder(sensor: As5600, encoder: JointEncoder) -> tuple[Level, str]:
    joint = encoder.joint
    try:
        measured = sensor.measure(encoder)
    except RobotError as error:
        return "bad", str(error)
    if not measured.detects_magnet:
        return "bad", f"The encoder of {joint} detects no magnet: fit one above the chip."
    if measured.too_weak or measured.too_strong:
        where = "far from" if measured.too_weak else "near to"
        return "bad", f"The magnet of {joint} is too {where} its encoder."
    return "good", f"The encoder of {joint} detects its magnet."


def wiring_checks(robot: StandingRobot) -> Iterator[Check]:
    """Yield the checks of a robot's wiring, one for each sensor that can be read."""
    if not robot.is_free:
        return
    if driven_pins(robot.guard) or servo_enables(robot.guard):
        yield Check("resistors", partial(_resistors, robot))
    if robot.has_pins:
        yield Check("emergency button", partial(_button, robot))
    yield Check("servo board", partial(_servo_boards, robot))
    for plan in robot.guard.sensors:
        # Those have checks of their own.
        if plan.driver not in {"as5600", DRIVER} and robot.can_read(plan):
            yield Check("sensor", partial(_read_sensor, robot, plan))
    yield Check("servo bus", partial(_servo_bus, robot))
    yield Check("encoders", partial(_encoders, robot))
