"""Wiring diagram, pins and parts of a robot, from its profile.

`python scripts/wiring_diagrams.py my-car.toml > my-car.svg` draws the diagram of a profile.
"""

import argparse
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from html import escape
from typing import Any, Final, NamedTuple, cast

import schemdraw
from schemdraw import elements as elm

from shapechanger.contract.plan import OutputPlan, SensorPlan
from shapechanger.robot.drivers.pins import BCM_OF_BOARD, I2C_PINS, NO_PIN
from shapechanger.robot.profile import Profile, find_profile, load_profile

_POSITIONS: Final = {pin: position for position, pin in BCM_OF_BOARD.items()}
_GROUNDS: Final = (6, 9, 14, 20, 25, 30, 34, 39)

# Nets, whose names the diagram writes at each terminal.
GROUND: Final = "GND"
LOGIC: Final = "3.3 V"
FIVE: Final = "5 V"
MOTORS: Final = "V MOTOR"
BATTERY: Final = "BATTERY"
ENABLE: Final = "ENABLE"
DIVIDER: Final = "DIVIDER"
"""Voltage divider instead of a pull resistor: 1 kOhm in the wire, and 2 kOhm from pin to ground."""


class Terminal(NamedTuple):
    """One terminal of a device."""

    label: str
    source: int | str  # The BCM pin that a wire leads to, or the name of a net.
    pull: str = ""  # Net that a resistor of 10 kOhm leads to, or DIVIDER; "" for no resistor.


@dataclass(frozen=True)
class Device:
    """A board, sensor or switch outside the Pi."""

    title: str
    note: str  # The second line of its box.
    wires: Mapping[str, int | str]  # BCM pin or net, keyed by label, of terminals that face the Pi.
    parts: tuple[tuple[str, int, str], ...]  # Name, number and purpose.
    loads: Mapping[str, str] = field(default_factory=dict[str, str])  # Loads of other terminals.
    pulls: Mapping[str, str] = field(default_factory=dict[str, str])  # Keyed by label; "": any pin.

    @property
    def terminals(self) -> list[Terminal]:
        """The terminals that face the Pi, without unused pins."""
        pull = self.pulls.get("", "")
        return [
            Terminal(label, to, self.pulls.get(label, pull) if isinstance(to, int) else "")
            for label, to in self.wires.items()
            if to != NO_PIN
        ]


def _i2c(bus: int) -> dict[str, int | str]:
    """Return the terminals of a board on an I2C bus."""
    sda, scl = I2C_PINS.get(bus, (f"I2C bus {bus}",) * 2)
    return {"SDA": sda, "SCL": scl, "VCC": LOGIC, "GND": GROUND}


def devices_of(profile: Profile) -> list[Device]:
    """Return the parts that are wired to the Pi, in the order of the diagram."""
    outputs = profile.outputs
    bridges = [one for one in outputs if one.driver in ("hbridge", "phase_enable")]
    found = [_bridge(bridges[at : at + 2], profile) for at in range(0, len(bridges), 2)]
    if profile.enable_pin is not None:
        load = ENABLE if bridges else "MOSFET in the motors' supply"
        found.append(_one_shot(profile.enable_pin, profile.enable_hold_ms, load))
    found += [_direct(one) for one in outputs if one.settings.get("over") in ("lgpio", "sysfs")]
    if profile.stop_pin is not None:
        wires = {"contact": profile.stop_pin, "ground": GROUND}
        parts = (("push button", 1, "emergency stop in the guard"),)
        found.append(Device("Emergency button", "pull-up in the Pi", wires, parts))
    boards: dict[tuple[int, int], list[OutputPlan]] = {}
    for one in (one for one in outputs if one.settings.get("over") == "pca9685"):
        boards.setdefault((one.settings["bus"], one.settings["address"]), []).append(one)
    found += map(_servo_board, boards.values())
    found += filter(None, map(_sensor, profile.sensors))
    if servos := [one for one in outputs if one.driver == "bus_servo"]:
        found.append(_servo_bus(servos))
    driver = "" if profile.camera is None else profile.camera.driver
    if driver in ("picamera2", "v4l2"):
        cable, part = "ribbon cable", "camera on the ribbon cable"
        if driver == "v4l2":
            cable, part = "USB", "webcam that sends JPEG"
        found.append(Device("Camera", "", {"cable": cable}, ((part, 1, "camera"),)))
    has_esc = any(one.driver == "esc" for one in outputs)
    if has_esc or any(MOTORS in device.wires.values() for device in found):
        plus = BATTERY if any(one.driver == "ina219" for one in profile.sensors) else MOTORS
        parts = (
            ("motor battery, with a fuse", 1, "never the Pi's 5 V"),
            ("latching switch", 1, "in the motors' supply: emergency stop without software"),
        )
        supply = {"+, fuse, switch": plus, "-": GROUND}
        found.append(Device("Battery", "with a fuse and a switch", {}, parts, supply))
    return found


def _bridge(outputs: list[OutputPlan], profile: Profile) -> Device:
    """Return an H-bridge board with one or two channels."""
    pins: dict[str, int | str] = {}
    for channel, one, two, output in zip("AB", "13", "24", outputs, strict=False):
        has = output.settings
        if output.driver == "hbridge":
            pins |= {f"IN{one}": has["forward"], f"IN{two}": has["backward"]}
        else:
            pins[f"PH{channel}"] = has["phase"]
        pins[f"EN{channel}"] = has.get("enable", NO_PIN)
    is_wired = any(one.settings.get("enable", NO_PIN) != NO_PIN for one in outputs)
    if not is_wired:
        pins["enable"] = LOGIC if profile.enable_pin is None else ENABLE
    note = "enable AND one-shot" if is_wired and profile.enable_pin is not None else ""
    parts = (
        ("H-bridge board, two channels (TB6612FNG, DRV8833; L298N above 6 V)", 1, "motors"),
        ("DC motor", len(outputs), ", ".join(one.part or one.name for one in outputs)),
    )
    loads = {f"OUT {'AB'[at]}": f"motor ({one.name})" for at, one in enumerate(outputs)}
    pins |= {"VM": MOTORS, "GND": GROUND}
    return Device("H-bridge", note, pins, parts, loads, {"": GROUND})


# K of t = K R C at 1 uF, ms per kOhm; docs/hardware.md gives its source.
_HOLD_OF_KOHM_MS: Final = 0.45


def _one_shot(pin: int, hold_ms: int, load: str) -> Device:
    resistor = f"{float(f'{hold_ms / _HOLD_OF_KOHM_MS:.2g}'):g}"
    wires = {"2B": pin, "2A": GROUND, "2RD": LOGIC, "2RCext": f"{resistor} kΩ to {LOGIC}"}
    wires["2Cext"] = "1 µF to 2RCext"
    parts = (
        ("74HC123", 1, "one-shot in the enable line"),
        (f"resistor {resistor} kOhm", 1, f"its time: {hold_ms} ms"),
        ("film or ceramic capacitor 1 uF", 1, "its time"),
    )
    note = f"drops after {hold_ms} ms"
    return Device("One-shot 74HC123", note, wires, parts, {"2Q": load}, {"": GROUND})


_ESC: Final = "speed controller (ESC) with its motor"


def _direct(output: OutputPlan) -> Device:
    """Return a servo or speed controller whose pulses come from the Pi."""
    name, settings = output.name, output.settings
    by_pin = settings["over"] == "lgpio"
    source = settings["pin"] if by_pin else f"PWM {settings['chip']}.{settings['channel']}"
    if output.driver != "esc":
        wires, parts = {"signal": source, "V+": "5 to 6 V", "GND": GROUND}, (("servo", 1, name),)
        return Device(f"Servo ({name})", "V+ not from the Pi", wires, parts, pulls={"": GROUND})
    wires, parts = {"signal": source, "battery +": MOTORS, "GND": GROUND}, ((_ESC, 1, name),)
    loads = {"motor wires": f"motor ({name})"}
    return Device(f"ESC ({name})", "BEC powers the servos", wires, parts, loads, {"": GROUND})


def _servo_board(outputs: list[OutputPlan]) -> Device:
    settings = outputs[0].settings
    enable = settings["output_enable"]
    motors = [one.name for one in outputs if one.driver == "esc"]
    wires = _i2c(settings["bus"]) | {"OE": GROUND if enable == NO_PIN else enable}
    wires["V+"] = "BEC of the ESC" if motors else "5 to 6 V supply"
    parts = (
        ("PCA9685 board", 1, "pulses for servos"),
        (_ESC, len(motors), ", ".join(motors)),
        ("servo", len(outputs) - len(motors), "its channels"),
        ("servo supply, 5 to 6 V", int(not motors), "V+ of the board"),
    )
    loads: dict[str, str] = {}
    for one in outputs:
        text = f"ESC ({one.name}), + V MOTOR" if one.driver == "esc" else f"servo ({one.name})"
        loads[str(one.settings["channel"])] = text
    note = f"address {settings['address']:#x}"
    return Device("PCA9685", note, wires, parts, loads, {"OE": LOGIC})


def _servo_bus(servos: list[OutputPlan]) -> Device:
    settings = servos[0].settings
    wires = {"USB": settings["device"], "supply": "servo supply", "GND": GROUND}
    parts = (
        ("USB adapter of the servo bus", 1, "with a latency timer of 1 ms"),
        (f"servo {settings['model']}", len(servos), "tendons"),
        ("spool", len(servos), f"radius {1e3 * settings['spool_radius_m']:g} mm"),
        ("servo supply, by the data sheet", 1, "never the Pi's 5 V"),
    )
    loads = {f"id {one.settings['id']}": f"{one.name}: {settings['model']}" for one in servos}
    return Device("Servo bus", "daisy chain", wires, parts, loads)


def _sensor(sensor: SensorPlan) -> Device | None:
    """Return a sensor; None for one of an unknown driver, or of the servo bus."""
    name, has = sensor.name, sensor.settings
    bus, note = _i2c(has.get("bus", 1)), f"address {has.get('address', has.get('mux', 0)):#x}"
    match sensor.driver:
        case "encoder":
            wires = {"A": has["a"], "B": has["b"], "VCC": LOGIC, "GND": GROUND}
            parts = (("wheel encoder, open collector or 3.3 V", 1, name),)
            return Device(f"Encoder ({name})", "3.3 V maximum", wires, parts)
        case "switch":
            wires = {f"contact {number}": pin for number, pin in enumerate(has["pins"], start=1)}
            wires["other side"] = GROUND if has["pull"] == "up" else LOGIC
            parts = (("switch", len(has["pins"]), f"{name}, in front"),)
            return Device(f"Switches ({name})", f"pull-{has['pull']} in the Pi", wires, parts)
        case "hcsr04":
            wires = {"Trig": has["trigger"], "Echo": has["echo"], "VCC": FIVE, "GND": GROUND}
            parts = (("HC-SR04", 1, f"distance: {name}"),)
            return Device("HC-SR04", name, wires, parts, pulls={"Echo": DIVIDER})
        case "mpu6050":
            return Device("MPU-6050", note, bus, (("MPU-6050 board", 1, name),))
        case "ina219":
            loads = {"Vin+": BATTERY, "Vin-": MOTORS}
            return Device("INA219", note, bus, (("INA219 board", 1, name),), loads)
        case "as5600":
            rows = has["rows"].items()
            loads = {f"channel {row['channel']}": f"AS5600 {joint}" for joint, row in rows}
            magnets = ("AS5600 board with a diametric magnet", len(loads), "joints")
            parts = (("TCA9548A board", 1, "multiplexer of the encoders"), magnets)
            return Device("TCA9548A", note, bus, parts, loads)
        case _:
            return None


def table(head: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    """Return a table in Markdown; its cells may hold any text."""
    titles = list(head)
    lines = [[" ".join(str(cell).split()).replace("|", r"\|") for cell in row] for row in rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in (titles, ["---"] * len(titles), *lines))


_RESISTORS: Final = {"": "", GROUND: ", 10 kOhm to ground", LOGIC: f", 10 kOhm to {LOGIC}"}
_RESISTORS[DIVIDER] = ", through 1 kOhm, and 2 kOhm from the pin to ground"


def pin_table(profile: Profile) -> str:
    """Return a Markdown table of the pins that a robot uses."""
    used: dict[int, list[str]] = {}
    for device in devices_of(profile):
        for label, source, pull in device.terminals:
            if isinstance(source, int):
                used.setdefault(source, []).append(f"{device.title} {label}{_RESISTORS[pull]}")
    if not used:
        return "None: everything is on a bus or a cable."
    rows = [(f"GPIO{pin}", _POSITIONS[pin], "; ".join(used[pin])) for pin in sorted(used)]
    grounds = " or ".join(", ".join(map(str, _GROUNDS)).rsplit(", ", 1))
    text = f"Ground is position {grounds}; 3.3 V are 1 and 17, 5 V are 2 and 4."
    return table(("pin", "position on the header", "connection"), rows) + f"\n\n{text}"


def part_list(profile: Profile) -> str:
    """Return a Markdown table of the parts of a robot."""
    counts = Counter({("Raspberry Pi 3B+ or newer, with its own supply", "computer"): 1})
    devices = devices_of(profile)
    for name, number, purpose in (part for device in devices for part in device.parts):
        counts[name, purpose] += number
    pulls = [wire.pull for device in devices for wire in device.terminals if wire.pull]
    divided = pulls.count(DIVIDER)
    counts["resistor 1 kOhm", "divider of the echo"] = divided
    counts["resistor 2 kOhm", "divider of the echo"] = divided
    counts["resistor 10 kOhm", "outputs are off until the guard runs"] = len(pulls) - divided
    rows = [(name, count, purpose) for (name, purpose), count in counts.items() if count]
    return table(("part", "number", "for"), rows)


# Drawing. Lengths are schemdraw's units, of 36 pixels.

_BOX_X: Final = 12.0
_BOX_WIDTH: Final = 5.4
_ROW: Final = 1.0
_TITLE: Final = 1.4
_WIRE: Final = 2.6
_INK: Final = "black"  # Replaced by the colour of the page's text.
_NETS_OF_HEADER: Final = {1: LOGIC, 17: LOGIC, 2: FIVE, 4: FIVE} | dict.fromkeys(_GROUNDS, "GND")


def draw_wiring(profile: Profile, name: str) -> str:
    """Return the wiring of a robot as an SVG element; its label contains `name`."""
    schemdraw.use("svg")
    devices = devices_of(profile)
    sources = {wire.source for device in devices for wire in device.terminals}
    pins = [source for source in sources if isinstance(source, int)]
    drawing = schemdraw.Drawing(
        show=False, fontsize=10, font="sans-serif", color=_INK, lw=1.3, margin=1.0
    )
    top = 0.0
    for device in devices:
        top = _draw_device(drawing, device, top)
    if pins:
        named = _NETS_OF_HEADER | {_POSITIONS[pin]: f"GPIO{pin}" for pin in pins}
        left = [f"{named.get(at, '')}  {at}" for at in range(1, 41, 2)]
        right = [f"{at}  {named.get(at, '')}" for at in range(2, 41, 2)]
        header = elm.Header(rows=20, cols=2, pinsleft=left, pinsright=right, shownumber=False)
        drawing += header.at((2.5, -12.6)).label("Raspberry Pi", "top")
    title = escape(f"Wiring of {name}: a Raspberry Pi with {', '.join(d.title for d in devices)}")
    drawn = drawing.get_imagedata("svg").decode().replace(_INK, "currentColor")
    return drawn.replace("<svg ", f'<svg class="wiring" role="img" aria-label="{title}" ', 1)


def _draw_device(drawing: schemdraw.Drawing, device: Device, top: float) -> float:
    """Draw a device, and return where the next one begins."""

    def write(x: float, y: float, text: str, align: str) -> None:
        label = elm.Label().at((x, y)).theta(0)
        drawing.add(label.label(text, ofst=0, halign=cast("Any", align), valign="center"))

    edge, first = _BOX_X + _BOX_WIDTH, top - _TITLE
    bottom = first - _ROW * (max(len(device.terminals), len(device.loads)) - 0.5)
    drawing += elm.Rect((0.0, bottom - top), (_BOX_WIDTH, 0.0)).at((_BOX_X, top)).theta(0)
    write(_BOX_X + _BOX_WIDTH / 2, top - 0.4, device.title, "center")
    write(_BOX_X + _BOX_WIDTH / 2, top - 0.85, device.note, "center")
    for at, (label, source, pull) in enumerate(device.terminals):
        y, end, middle = first - _ROW * at, _BOX_X - _WIRE, _BOX_X - _WIRE / 2
        is_pin = isinstance(source, int)
        drawing += elm.Line().at((_BOX_X, y)).to((end, y))
        write(_BOX_X + 0.15, y, label, "left")
        write(end - 0.15, y, f"GPIO{source} ({_POSITIONS[source]})" if is_pin else source, "right")
        if pull:
            drawing += elm.Dot(radius=0.06).at((middle, y))
            drawing += elm.RBox().at((middle, y)).down().length(0.7).scale(0.4)
            resistor = f"2 kΩ to {GROUND}" if pull == DIVIDER else f"10 kΩ to {pull}"
            write(middle - 0.2, y - 0.45, resistor, "right")
        if pull == DIVIDER:
            drawing += elm.RBox().at((_BOX_X, y)).left().length(_WIRE / 2).scale(0.4)
            write(_BOX_X - 0.15, y - 0.4, "1 kΩ", "right")
    for at, (label, load) in enumerate(device.loads.items()):
        y = first - _ROW * at
        drawing += elm.Line().at((edge, y)).to((edge + 0.6, y))
        write(edge - 0.15, y, label, "right")
        write(edge + 0.75, y, load, "left")
    return bottom - _ROW


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Print the wiring diagram of a robot, as SVG.")
    parser.add_argument("profile", help="name or path of a profile")
    path = find_profile(parser.parse_args().profile)
    print(draw_wiring(load_profile(path), path.stem))
