"""Wiring diagrams, pins and parts of a robot, from its profile.

`python scripts/wiring_diagrams.py my-car.toml --out my-car.svg` draws your own.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any, Final, cast

import schemdraw
from schemdraw import elements as elm

from shapechanger.contract.plan import OutputPlan, SensorPlan
from shapechanger.robot.drivers.pins import BCM_OF_BOARD, I2C_PINS
from shapechanger.robot.profile import Profile, find_profile, load_profile

_NO_PIN: Final = -1
_POSITIONS: Final = {pin: position for position, pin in BCM_OF_BOARD.items()}

# Nets that are drawn as flags and not as wires.
GROUND: Final = "GND"
LOGIC: Final = "3.3 V"
FIVE: Final = "5 V"
MOTORS: Final = "V MOTOR"
BATTERY: Final = "BATTERY"
ENABLE: Final = "ENABLE"


@dataclass(frozen=True)
class Terminal:
    """One terminal of a device."""

    label: str
    source: int | str  # The BCM pin that a wire leads to, or the flag of a net.
    pull: str = ""  # Net that a resistor of 10 kOhm leads to; "" for none.
    divider: bool = False  # Whether 1 kOhm lies in the wire, and 2 kOhm between pin and ground.


@dataclass(frozen=True)
class Load:
    """What the terminals `label` of a device drive."""

    label: str
    name: str  # Or a net.


@dataclass(frozen=True)
class Device:
    """A board, sensor or switch outside the Pi."""

    title: str
    note: str = ""  # A second line.
    terminals: tuple[Terminal, ...] = ()  # They face the Pi.
    loads: tuple[Load, ...] = ()
    parts: tuple[tuple[str, int, str], ...] = ()  # Name, number and purpose.


def devices_of(profile: Profile) -> list[Device]:
    """Return the parts that are wired to the Pi, in the order of the diagram."""
    outputs, sensors = profile.outputs, profile.sensors
    bridges = [one for one in outputs if one.driver in ("hbridge", "phase_enable")]
    found = [_bridge(bridges[at : at + 2], profile) for at in range(0, len(bridges), 2)]
    if profile.enable_pin is not None:
        found.append(_one_shot(profile.enable_pin, profile.enable_hold_ms, bool(bridges)))
    found += [_direct(one) for one in outputs if one.settings.get("over") in ("lgpio", "sysfs")]
    found += [_SENSORS[one.driver](one) for one in sensors if one.driver in _ON_PINS]
    if profile.stop_pin is not None:
        parts = (("push button", 1, "emergency stop in the guard"),)
        wires = _wires({"contact": profile.stop_pin, "ground": GROUND})
        found.append(Device("Emergency button", "pull-up in the Pi", wires, parts=parts))
    boards: dict[tuple[int, int], list[OutputPlan]] = {}
    for output in outputs:
        if output.settings.get("over") == "pca9685":
            key = output.settings["bus"], output.settings["address"]
            boards.setdefault(key, []).append(output)
    found += map(_servo_board, boards.values())
    on_bus = [one for one in sensors if one.driver in _SENSORS and one.driver not in _ON_PINS]
    found += [_SENSORS[one.driver](one) for one in on_bus]
    if servos := [one for one in outputs if one.driver == "bus_servo"]:
        found.append(_servo_bus(servos))
    if profile.camera is not None and profile.camera.driver in _CAMERAS:
        cable, part = _CAMERAS[profile.camera.driver]
        found.append(Device("Camera", "", _wires({"cable": cable}), parts=((part, 1, "camera"),)))
    speeds = any(one.driver == "esc" for one in outputs)
    if speeds or any(one.source == MOTORS for device in found for one in device.terminals):
        parts = (
            ("motor battery, with a fuse", 1, "never the Pi's 5 V"),
            ("latching switch", 1, "in the motors' supply: emergency stop without software"),
        )
        measured = any(one.driver == "ina219" for one in sensors)
        plus = BATTERY if measured else MOTORS
        supply = (Load("+, fuse, switch", plus), Load("-", GROUND))
        found.append(Device("Battery", "with a fuse and a switch", loads=supply, parts=parts))
    return found


def _wires(sources: Mapping[str, int | str], pull: str = "") -> tuple[Terminal, ...]:
    """Return terminals, keyed by label, without pins that are not used; `pull` is for the pins."""
    return tuple(
        Terminal(label, source, pull=pull if isinstance(source, int) else "")
        for label, source in sources.items()
        if source != _NO_PIN
    )


_CAMERAS: Final = {
    "picamera2": ("ribbon cable", "camera on the ribbon cable"),
    "v4l2": ("USB", "webcam that sends JPEG"),
}


def _bridge(outputs: list[OutputPlan], profile: Profile) -> Device:
    """Return an H-bridge board with one or two channels."""
    pins: dict[str, int | str] = {}
    loads: list[Load] = []
    wired = False
    for number, (channel, output) in enumerate(zip("AB", outputs, strict=False)):
        settings = output.settings
        if output.driver == "hbridge":
            pins[f"IN{2 * number + 1}"] = settings["forward"]
            pins[f"IN{2 * number + 2}"] = settings["backward"]
        else:
            pins[f"PH{channel}"] = settings["phase"]
        pins[f"EN{channel}"] = settings.get("enable", _NO_PIN)
        wired = wired or pins[f"EN{channel}"] != _NO_PIN
        loads.append(Load(f"OUT {channel}", f"motor ({output.name})"))
    if not wired:
        pins["enable"] = LOGIC if profile.enable_pin is None else ENABLE
    wires = _wires({**pins, "VM": MOTORS, "GND": GROUND}, pull=GROUND)
    parts = (
        ("H-bridge board, two channels (TB6612FNG, DRV8833; L298N above 6 V)", 1, "motors"),
        ("DC motor", len(outputs), ", ".join(one.part or one.name for one in outputs)),
    )
    note = "enable AND one-shot" if wired and profile.enable_pin is not None else ""
    return Device("H-bridge", note, wires, tuple(loads), parts)


# K of t = K R C at 1 uF, ms per kOhm; docs/hardware.md gives its source.
_HOLD_OF_KOHM_MS: Final = 0.45


def _one_shot(pin: int, hold_ms: int, for_bridges: bool) -> Device:
    resistor = f"{float(f'{hold_ms / _HOLD_OF_KOHM_MS:.2g}'):g}"
    timing = {"2RCext": f"{resistor} kΩ to {LOGIC}", "2Cext": "1 µF to 2RCext"}
    wires = _wires({"2B": pin, "2A": GROUND, "2RD": LOGIC, **timing}, pull=GROUND)
    parts = (
        ("74HC123", 1, "one-shot in the enable line"),
        (f"resistor {resistor} kOhm", 1, f"its time: {hold_ms} ms"),
        ("film or ceramic capacitor 1 uF", 1, "its time"),
    )
    load = Load("2Q", ENABLE if for_bridges else "MOSFET in the motors' supply")
    return Device("One-shot 74HC123", f"drops after {hold_ms} ms", wires, (load,), parts)


_ESC: Final = "speed controller (ESC) with its motor"


def _direct(output: OutputPlan) -> Device:
    """Return a servo or speed controller whose pulses come from the Pi."""
    settings = output.settings
    by_pin = settings["over"] == "lgpio"
    source = settings["pin"] if by_pin else f"PWM {settings['chip']}.{settings['channel']}"
    signal = Terminal("signal", source, pull=GROUND)
    if output.driver == "esc":
        wires = (signal, *_wires({"battery +": MOTORS, "GND": GROUND}))
        loads = (Load("motor wires", f"motor ({output.name})"),)
        parts = ((_ESC, 1, output.name),)
        return Device(f"ESC ({output.name})", "BEC powers the servos", wires, loads, parts)
    wires = (signal, *_wires({"V+": "5 to 6 V", "GND": GROUND}))
    parts = (("servo", 1, output.name),)
    return Device(f"Servo ({output.name})", "V+ not from the Pi", wires, parts=parts)


def _servo_board(outputs: list[OutputPlan]) -> Device:
    settings = outputs[0].settings
    enable = settings["output_enable"]
    held = Terminal("OE", enable, pull=LOGIC) if enable != _NO_PIN else Terminal("OE", GROUND)
    motors = [one.name for one in outputs if one.driver == "esc"]
    supply = "BEC of the ESC" if motors else "5 to 6 V supply"
    wires = (*_i2c(settings["bus"]), held, Terminal("V+", supply))
    names = {True: "ESC ({}), + V MOTOR", False: "servo ({})"}
    loads = tuple(
        Load(f"{one.settings['channel']}", names[one.driver == "esc"].format(one.name))
        for one in outputs
    )
    parts = (
        ("PCA9685 board", 1, "pulses for servos"),
        (_ESC, len(motors), ", ".join(motors)),
        ("servo", len(outputs) - len(motors), "its channels"),
        ("servo supply, 5 to 6 V", int(not motors), "V+ of the board"),
    )
    return Device("PCA9685", f"address {settings['address']:#x}", wires, loads, parts)


def _i2c(bus: int) -> tuple[Terminal, ...]:
    """Return the terminals of a board on an I2C bus."""
    pins = I2C_PINS.get(bus, (f"I2C bus {bus}",) * 2)
    lines = zip(("SDA", "SCL"), pins, strict=True)
    return (
        *(Terminal(label, pin) for label, pin in lines),
        *_wires({"VCC": LOGIC, "GND": GROUND}),
    )


def _servo_bus(servos: list[OutputPlan]) -> Device:
    model, device = servos[0].settings["model"], servos[0].settings["device"]
    loads = tuple(
        Load("", f"{one.name}: {one.settings['model']}, id {one.settings['id']}") for one in servos
    )
    wires = _wires({"USB": device, "supply": "servo supply", "GND": GROUND})
    parts = (
        ("USB adapter of the servo bus", 1, "with a latency timer of 1 ms"),
        (f"servo {model}", len(servos), "tendons"),
        ("spool", len(servos), f"radius {1e3 * servos[0].settings['spool_radius_m']:g} mm"),
        ("servo supply, by the data sheet", 1, "never the Pi's 5 V"),
    )
    return Device("Servo bus", "daisy chain", wires, loads, parts)


def _encoder(sensor: SensorPlan) -> Device:
    channels = {"A": sensor.settings["a"], "B": sensor.settings["b"]}
    wires = _wires({**channels, "VCC": LOGIC, "GND": GROUND})
    parts = (("wheel encoder, open collector or 3.3 V", 1, sensor.name),)
    return Device(f"Encoder ({sensor.name})", "3.3 V maximum", wires, parts=parts)


def _switch(sensor: SensorPlan) -> Device:
    pull, pins = sensor.settings["pull"], sensor.settings["pins"]
    contacts = {f"contact {number}": pin for number, pin in enumerate(pins, start=1)}
    wires = _wires({**contacts, "other side": GROUND if pull == "up" else LOGIC})
    parts = (("switch", len(pins), f"{sensor.name}, in front"),)
    return Device(f"Switches ({sensor.name})", f"pull-{pull} in the Pi", wires, parts=parts)


def _hcsr04(sensor: SensorPlan) -> Device:
    wires = (
        *_wires({"VCC": FIVE, "Trig": sensor.settings["trigger"]}),
        Terminal("Echo", sensor.settings["echo"], divider=True),
        Terminal("GND", GROUND),
    )
    parts = (
        ("HC-SR04", 1, f"distance: {sensor.name}"),
        ("resistor 1 kOhm", 1, "divider of the echo"),
        ("resistor 2 kOhm", 1, "divider of the echo"),
    )
    return Device("HC-SR04", sensor.name, wires, parts=parts)


def _board(title: str, *loads: Load) -> Callable[[SensorPlan], Device]:
    """Return a function that makes a sensor's board on an I2C bus."""

    def made(sensor: SensorPlan) -> Device:
        note = f"address {sensor.settings['address']:#x}"
        parts = ((f"{title} board", 1, sensor.name),)
        return Device(title, note, _i2c(sensor.settings["bus"]), loads, parts)

    return made


def _as5600(sensor: SensorPlan) -> Device:
    settings = sensor.settings
    loads = tuple(
        Load(f"channel {row['channel']}", f"AS5600 {joint}")
        for joint, row in settings["rows"].items()
    )
    parts = (
        ("TCA9548A board", 1, "multiplexer of the encoders"),
        ("AS5600 board with a diametric magnet", len(loads), "joints"),
    )
    return Device("TCA9548A", f"address {settings['mux']:#x}", _i2c(settings["bus"]), loads, parts)


_ON_PINS: Final = ("encoder", "switch", "hcsr04")
_SENSORS: Final[dict[str, Callable[[SensorPlan], Device]]] = {
    "encoder": _encoder,
    "switch": _switch,
    "hcsr04": _hcsr04,
    "mpu6050": _board("MPU-6050"),
    "ina219": _board("INA219", Load("Vin+", BATTERY), Load("Vin-", MOTORS)),
    "as5600": _as5600,
}


# Tables


def pin_table(profile: Profile) -> str:
    """Return a Markdown table of the pins that a robot uses."""
    used: dict[int, list[str]] = {}
    for device in devices_of(profile):
        for wire in device.terminals:
            if isinstance(wire.source, int):
                text = f"{device.title} {wire.label}"
                if wire.pull:
                    text += f", 10 kOhm to {'ground' if wire.pull == GROUND else wire.pull}"
                if wire.divider:
                    text += ", through 1 kOhm, and 2 kOhm from the pin to ground"
                used.setdefault(wire.source, []).append(text)
    if not used:
        return "None: everything is on a bus or a cable."
    rows = [f"| GPIO{pin} | {_POSITIONS[pin]} | {'; '.join(used[pin])} |" for pin in sorted(used)]
    head = ["| pin | position on the header | connection |", "|---|---|---|"]
    *most, last = map(str, _GROUNDS)
    grounds = f"Ground is position {', '.join(most)} or {last}"
    return "\n".join([*head, *rows, "", f"{grounds}; 3.3 V are 1 and 17, 5 V are 2 and 4."])


_GROUNDS: Final = (6, 9, 14, 20, 25, 30, 34, 39)


def part_list(profile: Profile) -> str:
    """Return a Markdown table of the parts of a robot."""
    counts: dict[str, tuple[int, list[str]]] = {
        "Raspberry Pi 3B+ or newer, with its own supply": (1, ["computer"])
    }
    found = devices_of(profile)
    pulls = sum(bool(wire.pull) for device in found for wire in device.terminals)
    parts = [part for device in found for part in device.parts]
    if pulls:
        parts.append(("resistor 10 kOhm", pulls, "outputs are off until the guard runs"))
    for name, number, purpose in parts:
        if number:
            count, purposes = counts.get(name, (0, []))
            counts[name] = count + number, list(dict.fromkeys([*purposes, purpose]))
    rows = [f"| {name} | {count} | {'; '.join(why)} |" for name, (count, why) in counts.items()]
    return "\n".join(["| part | number | for |", "|---|---|---|", *rows])


# Drawing. Lengths are schemdraw's units, of 36 pixels.

_BOX_X: Final = 12.0
_BOX_WIDTH: Final = 5.4
_ROW: Final = 0.8
_PULLED_ROW: Final = 1.3
_TITLE: Final = 1.4
_GAP: Final = 0.8
_WIRE: Final = 2.6
_INK: Final = "black"  # The page's colour takes its place.
_COLOURS: Final = (
    *("#d1495b", "#2e7dd1", "#2a9d4a", "#8e5cc9", "#b8740b", "#0d8f9c", "#c2408f", "#6b7f1e"),
    *("#9c6b4f", "#5b6fb5", "#e0562b", "#4f8f7a"),
)
_NETS_OF_HEADER: Final = {1: LOGIC, 17: LOGIC, 2: FIVE, 4: FIVE} | dict.fromkeys(_GROUNDS, "GND")


def draw_wiring(profile: Profile, name: str) -> str:
    """Return the wiring of a robot as an SVG element.

    A wire carries the pin that it leads to, in the pin's colour; text and boxes have the page's.

    Args:
        profile: The profile.
        name: What the image is called.
    """
    schemdraw.use("svg")
    devices = devices_of(profile)
    wires = (wire for device in devices for wire in device.terminals)
    pins = list(dict.fromkeys(wire.source for wire in wires if isinstance(wire.source, int)))
    colours = {pin: _COLOURS[at % len(_COLOURS)] for at, pin in enumerate(pins)}
    drawing = schemdraw.Drawing(
        show=False, fontsize=10, font="sans-serif", color=_INK, lw=1.3, margin=1.0
    )
    top = 0.0
    for device in devices:
        top = _draw_device(drawing, device, top, colours) - _GAP
    if pins:
        named = _NETS_OF_HEADER | {_POSITIONS[pin]: f"GPIO{pin}" for pin in pins}
        left = [f"{named.get(at, '')}  {at}" for at in range(1, 41, 2)]
        right = [f"{at}  {named.get(at, '')}" for at in range(2, 41, 2)]
        header = elm.Header(rows=20, cols=2, pinsleft=left, pinsright=right, shownumber=False)
        drawing += header.at((2.5, -12.6)).label("Raspberry Pi", "top")
    title = escape(f"Wiring of {name}: a Raspberry Pi with {', '.join(d.title for d in devices)}")
    drawn = drawing.get_imagedata("svg").decode().replace(_INK, "currentColor")
    _, attributes, body = re.split(r"(?<=<svg )([^>]*)>", drawn, maxsplit=1)
    size = re.findall(r'viewBox="[^"]*"', attributes)
    head = f'class="wiring" role="img" xmlns="http://www.w3.org/2000/svg" {size[0]}'
    return f'<svg {head} aria-label="{title}">\n<title>{title}</title>\n{body}'


def _draw_device(
    drawing: schemdraw.Drawing, device: Device, top: float, colours: Mapping[int, str]
) -> float:
    """Draw a device, and return its lower end."""
    y = first = top - (_TITLE if device.note else _TITLE - 0.4)
    for wire in device.terminals:
        _draw_wire(drawing, wire, y, colours)
        y -= _PULLED_ROW if wire.pull or wire.divider else _ROW
    loads, edge = first, _BOX_X + _BOX_WIDTH
    for load in device.loads:
        drawing += elm.Line().at((edge, loads)).to((edge + 0.6, loads))
        _write(drawing, edge - 0.15, loads, load.label, "right")
        _write(drawing, edge + 0.75, loads, load.name, "left")
        loads -= _ROW
    bottom = min(y, loads, first - _ROW) + _ROW / 2
    drawing += elm.Rect((0.0, bottom - top), (_BOX_WIDTH, 0.0)).at((_BOX_X, top)).theta(0)
    _write(drawing, _BOX_X + _BOX_WIDTH / 2, top - 0.4, device.title, "center")
    _write(drawing, _BOX_X + _BOX_WIDTH / 2, top - 0.85, device.note, "center")
    return bottom


def _draw_wire(
    drawing: schemdraw.Drawing, wire: Terminal, y: float, colours: Mapping[int, str]
) -> None:
    pin, colour, text = wire.source, _INK, str(wire.source)
    if isinstance(pin, int):
        colour, text = colours[pin], f"GPIO{pin} ({_POSITIONS[pin]})"
    end, middle = _BOX_X - _WIRE, (_BOX_X - _WIRE / 2, y)
    drawing += elm.Line().at((_BOX_X, y)).to((end, y)).color(colour)
    _write(drawing, _BOX_X + 0.15, y, wire.label, "left")
    _write(drawing, end - 0.15, y, text, "right", colour)
    if wire.pull or wire.divider:
        drawing += elm.Dot(radius=0.06).at(middle).color(colour)
        drawing += elm.RBox().at(middle).down().length(0.8).scale(0.4)
        resistor = f"{'10 kΩ' if wire.pull else '2 kΩ'} to {wire.pull or GROUND}"
        _write(drawing, middle[0] - 0.2, y - 0.5, resistor, "right")
    if wire.divider:
        drawing += elm.RBox().at((_BOX_X, y)).left().length(_WIRE / 2).scale(0.4).color(colour)
        _write(drawing, _BOX_X - 0.15, y - 0.4, "1 kΩ", "right")


def _write(
    drawing: schemdraw.Drawing, x: float, y: float, text: str, align: str, colour: str = _INK
) -> None:
    label = elm.Label().at((x, y)).theta(0).color(colour)
    drawing += label.label(text, ofst=0, halign=cast("Any", align), valign="center")


def main() -> None:
    """Write the diagram of a profile."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("profile", help="name or path of a profile")
    parser.add_argument("--out", type=Path, required=True, help="the SVG to write")
    asked = parser.parse_args()
    path = find_profile(asked.profile)
    asked.out.write_text(draw_wiring(load_profile(path), path.stem) + "\n")


if __name__ == "__main__":
    main()
