"""Wiring diagrams, pins and parts of a robot, from its profile.

`python scripts/wiring_diagrams.py my-car.toml --out my-car.svg` draws your own.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Final

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
    bus: bool = False  # Whether other devices share the wire.


@dataclass(frozen=True)
class Load:
    """What the terminals `label` of a device drive."""

    label: str
    name: str
    kind: str = "box"  # "motor", "box", "net", or "chain" for a box that hangs on the one above.


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
        supply = (Load("+, fuse, switch", plus, "net"), Load("-", GROUND, "net"))
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
        loads.append(Load(f"OUT {channel}", output.name, "motor"))
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
    load = Load("2Q", ENABLE if for_bridges else "MOSFET in the motors' supply", "net")
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
        loads = (Load("motor wires", output.name, "motor"),)
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
    words = f"I2C bus {bus}"
    pins = I2C_PINS.get(bus, (words, words))
    lines = zip(("SDA", "SCL"), pins, strict=True)
    return (
        *(Terminal(label, pin, bus=pin != words) for label, pin in lines),
        *_wires({"VCC": LOGIC, "GND": GROUND}),
    )


def _servo_bus(servos: list[OutputPlan]) -> Device:
    model, device = servos[0].settings["model"], servos[0].settings["device"]
    loads = tuple(
        Load("", f"{one.name}: {one.settings['model']}, id {one.settings['id']}", "chain")
        for one in servos
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
    "ina219": _board("INA219", Load("Vin+", BATTERY, "net"), Load("Vin-", MOTORS, "net")),
    "as5600": _as5600,
}


# Tables


def pin_table(profile: Profile) -> str:
    """Return a Markdown table of the pins that a robot uses."""
    used: dict[int, list[str]] = {}
    for device in devices_of(profile):
        for wire in device.terminals:
            if isinstance(wire.source, int):
                words = f"{device.title} {wire.label}"
                if wire.pull:
                    words += f", 10 kOhm to {'ground' if wire.pull == GROUND else wire.pull}"
                if wire.divider:
                    words += ", through 1 kOhm, and 2 kOhm from the pin to ground"
                used.setdefault(wire.source, []).append(words)
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


# Drawing. Lengths are pixels.

_WIDTH: Final = 940
_HEADER_X: Final = 40
_HEADER_PITCH: Final = 17
_PI_X: Final = 130
_PI_WIDTH: Final = 130
_PI_EDGE: Final = _PI_X + _PI_WIDTH
_BUS_X: Final = 330  # Of the first wire that several devices share.
_BUS_PITCH: Final = 14
_PULL_X: Final = 385
_FLAG_X: Final = 470  # Where flags of nets end.
_BOX_X: Final = 500
_BOX_WIDTH: Final = 190
_BOX_EDGE: Final = _BOX_X + _BOX_WIDTH
_LOAD_X: Final = 740
_LOAD_WIDTH: Final = 190
_ROW: Final = 26
_PULLED_ROW: Final = 46
_LOAD_ROW: Final = 34
_TITLE: Final = 52
_GAP: Final = 26
_TOP: Final = 40
_COLOURS: Final = (
    *("#d1495b", "#2e7dd1", "#2a9d4a", "#8e5cc9", "#b8740b", "#0d8f9c", "#c2408f", "#6b7f1e"),
    *("#9c6b4f", "#5b6fb5", "#e0562b", "#4f8f7a"),
)


@dataclass
class _Drawing:
    """Elements of an image, the colours of pins, and the places of wires that devices share."""

    elements: list[str] = field(default_factory=list[str])
    colours: dict[int, str] = field(default_factory=dict[int, str])
    shared: dict[int, list[float]] = field(default_factory=dict[int, list[float]])

    def add(self, tag: str, content: str = "", **attributes: float | str) -> None:
        given = {"fill": "none", "stroke": "currentColor", "stroke-width": 1.5}
        if tag == "text":
            given = {}
        given |= {name.replace("_", "-"): value for name, value in attributes.items()}
        texts = (
            f'{name}="{value if isinstance(value, str) else f"{value:g}"}"'
            for name, value in given.items()
        )
        self.elements.append(f"<{tag} {' '.join(texts)}>{escape(content)}</{tag}>")

    def colour(self, pin: int) -> str:
        """Return the colour of a pin's wire."""
        return self.colours.setdefault(pin, _COLOURS[len(self.colours) % len(_COLOURS)])

    def line(self, *points: tuple[float, float], colour: str = "currentColor") -> None:
        path = " ".join(f"{x:g},{y:g}" for x, y in points)
        self.add("polyline", points=path, stroke=colour, stroke_width=2)

    def text(
        self, x: float, y: float, words: str, anchor: str = "start", bold: bool = False
    ) -> None:
        weight = "bold" if bold else "normal"
        self.add("text", words, x=x, y=y + 4, text_anchor=anchor, font_weight=weight)

    def dot(self, x: float, y: float, colour: str) -> None:
        self.add("circle", cx=x, cy=y, r=3.5, fill=colour, stroke="none")

    def box(self, x: float, y: float, width: float, height: float, fill: str = "none") -> None:
        self.add("rect", x=x, y=y, width=width, height=height, rx=4, fill=fill)

    def resistor(self, x: float, y: float, net: str, words: str) -> None:
        """Draw a resistor down from a wire to ground, or to the flag of a net."""
        self.line((x, y), (x, y + 6))
        self.box(x - 4, y + 6, 8, 16)
        self.line((x, y + 22), (x, y + 27))
        self.text(x + 9, y + 14, words)
        if net == GROUND:
            self.ground(x, y + 27)
        else:
            self.line((x - 8, y + 27), (x + 8, y + 27))
            self.text(x + 11, y + 29, net)

    def ground(self, x: float, y: float) -> None:
        for half, down in ((8, 0), (5, 4), (2, 8)):
            self.line((x - half, y + down), (x + half, y + down))

    def bus_x(self, pin: int) -> float:
        return _BUS_X + _BUS_PITCH * list(self.shared).index(pin)


def draw_wiring(profile: Profile, name: str) -> str:
    """Return the wiring of a robot as an SVG element.

    Wires have the colours of their positions on the header; text and boxes have the page's.

    Args:
        profile: The profile.
        name: What the image is called.
    """
    drawing = _Drawing()
    devices = devices_of(profile)
    y = float(_TOP)
    for device in devices:
        y = _draw_device(drawing, device, y) + _GAP
    # Wires that several devices share lead from the first to the last one.
    for pin, places in drawing.shared.items():
        if len(places) > 1:
            x, colour = drawing.bus_x(pin), drawing.colour(pin)
            drawing.line((x, places[0]), (x, places[-1]), colour=colour)
            for place in places[:-1]:
                drawing.dot(x, place, colour)
    if any(isinstance(one.source, int) for device in devices for one in device.terminals):
        y = max(y, _TOP + 24.0 * _HEADER_PITCH)
        _draw_header(drawing)
        drawing.box(_PI_X, _TOP - 26, _PI_WIDTH, y - _GAP - _TOP + 40)
        drawing.text(_PI_X + _PI_WIDTH / 2, _TOP - 10, "Raspberry Pi", "middle", bold=True)
    what = ", ".join(device.title for device in devices)
    title = escape(f"Wiring of {name}: a Raspberry Pi with {what}")
    body = "\n".join(drawing.elements)
    return (
        f'<svg class="wiring" xmlns="http://www.w3.org/2000/svg" role="img" '
        f'viewBox="0 0 {_WIDTH} {y:g}" font-family="sans-serif" font-size="13" '
        f'fill="currentColor" aria-label="{title}">\n<title>{title}</title>\n{body}\n</svg>'
    )


def _draw_device(drawing: _Drawing, device: Device, top: float) -> float:
    """Draw a device, and return its lower end."""
    first = top + _TITLE if device.note else top + _TITLE - 18
    y = first
    for wire in device.terminals:
        _draw_wire(drawing, wire, y)
        y += _PULLED_ROW if wire.pull or wire.divider else _ROW
    loads = first
    for load in device.loads:
        hangs = load.kind == "chain" and loads > first
        _draw_load(drawing, load, loads, _LOAD_ROW if hangs else 0)
        loads += _LOAD_ROW
    bottom = max(y, loads, first + _ROW) - _ROW / 2
    drawing.box(_BOX_X, top, _BOX_WIDTH, bottom - top)
    middle = _BOX_X + _BOX_WIDTH / 2
    drawing.text(middle, top + 12, device.title, "middle", bold=True)
    drawing.text(middle, top + 28, device.note, "middle")
    return bottom


def _draw_wire(drawing: _Drawing, wire: Terminal, y: float) -> None:
    drawing.text(_BOX_X + 8, y, wire.label)
    colour = "currentColor"
    if isinstance(wire.source, str):
        start = _PULL_X - 10 if wire.pull else _FLAG_X + 8
        if wire.source == GROUND:
            drawing.line((_FLAG_X + 8, y), (_FLAG_X + 8, y + 4))
            drawing.ground(_FLAG_X + 8, y + 4)
        else:
            drawing.text(start - 6, y, wire.source, "end")
    else:
        pin, colour = wire.source, drawing.colour(wire.source)
        start = drawing.bus_x(pin) if pin in drawing.shared else _PI_EDGE
        if wire.bus:
            drawing.shared.setdefault(pin, []).append(y)
        if start == _PI_EDGE:
            drawing.text(_PI_EDGE - 8, y, f"GPIO{pin}  ({_POSITIONS[pin]})", "end")
    drawing.line((start, y), (_BOX_X, y), colour=colour)
    if wire.pull or wire.divider:
        drawing.dot(_PULL_X, y, colour)
        drawing.resistor(_PULL_X, y, wire.pull or GROUND, "10 kΩ" if wire.pull else "2 kΩ")
    if wire.divider:
        drawing.box(430, y - 4, 22, 8, fill="var(--md-default-bg-color, white)")
        drawing.text(441, y - 12, "1 kΩ", "middle")


def _draw_load(drawing: _Drawing, load: Load, y: float, hangs: float) -> None:
    """Draw a load, at the device or below another load that is `hangs` higher."""
    drawing.text(_BOX_EDGE - 8, y, load.label, "end")
    if load.kind == "net":
        drawing.line((_BOX_EDGE, y), (_BOX_EDGE + 22, y))
        drawing.text(_BOX_EDGE + 28, y, load.name)
    elif load.kind == "motor":
        for offset in (-5, 5):
            drawing.line((_BOX_EDGE, y + offset), (_LOAD_X + 2, y + offset))
        drawing.add("circle", cx=_LOAD_X + 13, cy=y, r=12)
        drawing.text(_LOAD_X + 13, y, "M", "middle")
        drawing.text(_LOAD_X + 32, y, load.name)
    else:
        if hangs:
            drawing.line((_LOAD_X + 20, y - hangs + 12), (_LOAD_X + 20, y - 12))
        else:
            drawing.line((_BOX_EDGE, y), (_LOAD_X, y))
        drawing.box(_LOAD_X, y - 12, _LOAD_WIDTH, 24)
        drawing.text(_LOAD_X + 8, y, load.name)


def _draw_header(drawing: _Drawing) -> None:
    """Draw the header's 40 positions, with the used ones in the colours of their wires."""
    drawing.text(_HEADER_X + 8, _TOP - 10, "Header", "middle", bold=True)
    for position in range(1, 41):
        row, right = divmod(position - 1, 2)
        x, y = _HEADER_X + 17 * right, _TOP + _HEADER_PITCH * (row + 0.6)
        used = drawing.colours.get(BCM_OF_BOARD.get(position, _NO_PIN), "none")
        colour = "currentColor" if position in _GROUNDS else used
        drawing.add("circle", cx=x, cy=y, r=6, fill=colour, stroke_width=1)
        drawing.text(x + (12 if right else -12), y, str(position), "start" if right else "end")
    for number, words in enumerate(("filled: GND", "1, 17: 3.3 V", "2, 4: 5 V")):
        drawing.text(_HEADER_X + 8, _TOP + _HEADER_PITCH * (21 + number), words, "middle")


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
