"""Schema of profiles: every table, its keys, units and bounds, and how a table is read."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import date, datetime
from typing import Any, Final, Literal, cast

from shapechanger.errors import ProfileError
from shapechanger.robot.cameras.camera import CAMERA_DRIVERS
from shapechanger.robot.drivers.output import OUTPUT_DRIVERS
from shapechanger.robot.drivers.sensor import SENSOR_DRIVERS
from shapechanger.robot.drivers.servos.settings import MODELS
from shapechanger.robot.profile.mistakes import Place, Source, called, choice, nearest, shown
from shapechanger.robot.profile.pins import HIGHEST_BCM, bcm

_UNITS: Final = {
    "_deg_per_s": "degrees a second",
    "_deg_per_m": "degrees a metre",
    "_deg": "degrees",
    "_per_s": "per second",
    "_hz": "hertz",
    "_ms": "milliseconds",
    "_us": "microseconds",
    "_m": "metres",
    "_s": "seconds",
    "_v": "volts",
    "_c": "degrees Celsius",
}
"""Units by the suffix of a key, longest first."""

# Common alternative spellings.
_OTHER_ENDS: Final = ("_rad", "_cm", "_mm", "_km", "_mv", "_f", "_sec", "_khz", "_min")


def unit_of(key: str) -> str:
    """Return the unit in the suffix of a key, in words; empty for none."""
    return next((unit for end, unit in _UNITS.items() if key.endswith(end)), "")


def _stem_of(key: str) -> str:
    """Return the name of a key without its unit."""
    return next((key.removesuffix(e) for e in (*_UNITS, *_OTHER_ENDS) if key.endswith(e)), key)


def with_unit(key: str, known: Iterable[str]) -> str | None:
    """Return the known key with the same stem and another unit; None if there is none.

    Args:
        key: A key, such as "bump_hold_s".
        known: The known keys.
    """
    return next((k for k in known if unit_of(k) and _stem_of(k) == _stem_of(key)), None)


Kind = Literal[
    "number", "whole", "text", "truth", "pin", "pins", "size", "weights", "date", "choice"
]
"""Kind of value of a key."""

REQUIRED: Final = object()
"""Marks a key without a default."""

NO_PIN: Final = -1
"""Value of an unconnected pin."""

_LONGEST_TEXT: Final = 64  # As in the messages, see `shapechanger.robot.link.messages`.
_NOT_PRINTABLE: Final = re.compile(r"[^\x20-\x7e\xa0-\U0010ffff]")
_A_PIN: Final = f'a BCM pin from 0 to {HIGHEST_BCM}, such as 22, "GPIO22" or "BOARD15"'


@dataclass(frozen=True, slots=True)
class ProfileKey:
    """One key of a table.

    Attributes:
        name: Name, with the unit as its suffix.
        kind: Kind of value.
        default: Value if it is omitted; `REQUIRED` if it must not be.
        low: Lower bound.
        high: Upper bound; infinity requires `above`.
        above: Whether `low` is exclusive.
        names: Options of a "choice".
        longest: Largest number of characters of a text.
    """

    name: str
    kind: Kind
    default: Any = REQUIRED
    low: float = 0.0
    high: float = math.inf
    above: bool = False
    names: tuple[str, ...] = ()
    longest: int = _LONGEST_TEXT

    @property
    def wanted(self) -> str:
        """Describe the permitted values."""
        unit = unit_of(self.name)
        match self.kind:
            case "number":
                return f"a number{self._range()}{f' ({unit})' if unit else ''}"
            case "whole":
                return f"a whole number{self._range()}{f' ({unit})' if unit else ''}"
            case "text":
                return f"a text of 1 to {self.longest} characters that can be printed"
            case "truth":
                return "true or false"
            case "pin":
                return _A_PIN if self.default != NO_PIN else f"{_A_PIN}, or {NO_PIN} for none"
            case "pins":
                return f"a list of pins, each {_A_PIN}"
            case "size":
                low, high = int(self.low), int(self.high)
                return f"[width, height] in pixels, each an even number from {low} to {high}"
            case "weights":
                return f"a table of numbers{self._range()} by name of action"
            case "date":
                return "a date, such as 2026-11-03"
            case "choice":
                return f"one of {', '.join(repr(name) for name in self.names if name)}"

    def value_of(self, written: Any) -> Any:
        """Convert and check a value.

        Raises:
            ValueError: If it is not permitted; the message continues that of `wanted`.
        """
        try:
            return self._value_of(written)
        except ValueError as error:
            raise ValueError(str(error) or f"not {shown(written)}") from None

    def _value_of(self, written: Any) -> Any:
        match self.kind:
            case "number":
                return self._number(written)
            case "whole":
                if type(written) is not int:
                    raise ValueError
                self._number(written)
                return written
            case "pin":
                if type(written) is int and written == self.default == NO_PIN:
                    return NO_PIN
                return bcm(written)
            case "pins":
                return self._pins(written)
            case "size":
                return self._size(written)
            case "weights":
                return self._weights(written)
            case "choice":
                if not isinstance(written, str):
                    raise ValueError
                if written not in self.names:
                    raise ValueError(f"not {written!r}{nearest(written, self.names)}")
            case "text":
                ok = isinstance(written, str) and 1 <= len(written) <= self.longest
                if not ok or _NOT_PRINTABLE.search(written) or not written.strip():
                    raise ValueError
            case "truth":
                if not isinstance(written, bool):
                    raise ValueError
            case "date":
                if not isinstance(written, date) or isinstance(written, datetime):
                    raise ValueError
        return written

    def _range(self) -> str:
        low, high = f"{self.low:g}", f"{self.high:g}"
        if math.isinf(self.high):
            return f" above {low}"
        return f" above {low} and up to {high}" if self.above else f" from {low} to {high}"

    def _number(self, written: Any) -> float:
        if type(written) not in (int, float):
            raise ValueError
        # Also refuses NaN.
        if not self.low <= written <= self.high or (self.above and written == self.low):
            raise ValueError
        try:
            return float(written)
        except OverflowError:
            raise ValueError from None

    def _pins(self, written: Any) -> list[int]:
        if not isinstance(written, list) or not written:
            raise ValueError
        pins: list[int] = []
        for pin in cast("list[Any]", written):
            try:
                pins.append(bcm(pin))
            except ValueError as error:
                raise ValueError(str(error) or f"and {shown(pin)} is none") from None
        return pins

    def _size(self, written: Any) -> tuple[int, int]:
        if not isinstance(written, list):
            raise ValueError
        sides = cast("list[Any]", written)
        if len(sides) != 2 or any(type(side) is not int or side % 2 for side in sides):
            raise ValueError
        width, height = (int(self._number(side)) for side in sides)
        return width, height

    def _weights(self, written: Any) -> dict[str, float]:
        if not isinstance(written, dict):
            raise ValueError
        weights: dict[str, float] = {}
        for name, weight in cast("dict[str, Any]", written).items():
            try:
                weights[name] = self._number(weight)
            except ValueError:
                raise ValueError(f"and the one of {name} is {shown(weight)}") from None
        return weights


TABLES: Final = (
    "robot",
    "action",
    "output",
    "sensor",
    "camera",
    "limits",
    "stop",
    "reward",
    "reset",
    "enable",
    "emergency_button",
    "servo_bus",
)
"""Tables of a profile; `action`, `output` and `sensor` hold one table per name."""

DRIVING_PARTS: Final = (
    "wheels",
    "left track",
    "right track",
    "propeller",
    "left propeller",
    "right propeller",
)
"""Parts that propel the robot."""

PARTS: Final = (*DRIVING_PARTS, "steering", "rudder", "gear", "bed", "joint", "tendon")
"""Parts that an output may move."""

OVER_KEY: Final = ProfileKey("over", "choice", names=("pca9685", "lgpio", "sysfs"))
"""Source of the pulses of a servo or a controller."""

MEASURES: Final = {
    "encoder": "speed",
    "switch": "bump",
    "hcsr04": "distance",
    "mpu6050": "imu",
    "ina219": "battery",
    "cpu_temperature": "temperature",
    "bus_servo": "tendons",
    "as5600": "joints",
}
"""Measurement of each sensor driver, as in `SensorPlan.measures`."""

ROBOT_KEYS: Final = (
    ProfileKey("name", "text"),
    ProfileKey("body", "text"),
    ProfileKey("control_hz", "number", 20.0, low=1.0, high=100.0),
    ProfileKey("calibrated", "date", None),
    # How fast the robot turns at full steering: by the metre, as with wheels, and by the second, as
    # with tracks.
    ProfileKey("turn_deg_per_m", "number", None, low=0.0, high=10_000.0),
    ProfileKey("turn_deg_per_s", "number", None, low=0.0, high=10_000.0),
)

ACTION_KEYS: Final = (
    ProfileKey("low", "number", None, low=-1.0, high=1.0),
    ProfileKey("high", "number", 1.0, low=-1.0, high=1.0),
    ProfileKey("rest", "number", 0.0, low=-1.0, high=1.0),
    ProfileKey("slew_per_s", "number", math.inf, low=0.0, above=True),
    ProfileKey("slew_down_per_s", "number", math.inf, low=0.0, above=True),
    ProfileKey("levels", "choice", "any", names=("any", "three")),
    ProfileKey("threshold", "number", 0.33, low=0.0, high=1.0, above=True),
    ProfileKey("propels", "truth", False),
    ProfileKey("one_sided", "truth", False),
    ProfileKey("unit", "choice", "1", names=("1", "deg", "rad", "m", "m/s", "N", "N·m")),
    ProfileKey("gain", "number", 1.0, low=0.0, high=1e6, above=True),
)

OUTPUT_KEYS: Final = (
    ProfileKey("driver", "choice", names=tuple(OUTPUT_DRIVERS)),
    ProfileKey("part", "choice", "", names=("", *PARTS)),
    ProfileKey("mix", "weights", low=-10.0, high=10.0),
    ProfileKey("offset", "number", 0.0, low=-1.0, high=1.0),
)

_BUS: Final = ProfileKey("bus", "whole", 1, low=0, high=99)
_PULSES: Final = (OVER_KEY, ProfileKey("hz", "whole", 50, low=40, high=400))
_DUTY: Final = (
    # gpiozero's software PWM takes up to 10 kHz.
    ProfileKey("pwm_hz", "whole", 50, low=1, high=10_000),
    ProfileKey("start", "number", 0.0, low=0.0, high=1.0),
    ProfileKey("full", "number", 1.0, low=0.0, high=1.0, above=True),
)


def _width(name: str, default: int) -> ProfileKey:
    # Widths that lgpio.tx_servo accepts; servos and controllers use no others.
    return ProfileKey(name, "whole", default, low=500, high=2500)


OUTPUT_SETTINGS: Final = {
    "hbridge": (
        ProfileKey("forward", "pin"),
        ProfileKey("backward", "pin"),
        ProfileKey("enable", "pin", NO_PIN),
        *_DUTY,
    ),
    "phase_enable": (ProfileKey("phase", "pin"), ProfileKey("enable", "pin"), *_DUTY),
    "servo": (
        *_PULSES,
        _width("left_us", 1000),
        _width("centre_us", 1500),
        _width("right_us", 2000),
        ProfileKey("travel_deg_per_s", "number", math.inf, low=0.0, above=True),
    ),
    "esc": (
        *_PULSES,
        _width("backward_us", 1000),
        _width("neutral_us", 1500),
        _width("forward_us", 2000),
        ProfileKey("arm_s", "number", 2.5, low=0.0, high=30.0),
        ProfileKey("reverse", "choice", "direct", names=("direct", "double", "none")),
        ProfileKey("brake_ms", "whole", 200, low=0, high=2000),
    ),
    "bus_servo": (
        ProfileKey("id", "whole", low=0, high=253),
        ProfileKey("model", "choice", names=tuple(MODELS)),
        ProfileKey("spool_radius_m", "number", low=0.0, high=0.1, above=True),
        ProfileKey("direction", "whole", 1, low=-1, high=1),
        ProfileKey("most_tension_n", "number", low=0.0, high=1000.0, above=True),
        ProfileKey("pretension_n", "number", low=0.0, high=1000.0, above=True),
        ProfileKey("homing_n", "number", 3.0, low=0.0, high=1000.0, above=True),
        ProfileKey("control", "choice", "tension", names=("tension", "length")),
        ProfileKey("longest_m", "number", 0.0, low=-1.0, high=1.0),
        ProfileKey("shortest_m", "number", 0.0, low=-1.0, high=1.0),
        # Position of the servo with a straight finger, in counts of 1/4096 turn.
        ProfileKey("zero", "whole", 0, low=-1_000_000, high=1_000_000),
    ),
}
"""Keys of each output driver, besides those of its pulse source."""

OVER_SETTINGS: Final = {
    "pca9685": (
        _BUS,
        ProfileKey("address", "whole", 0x40, low=0x40, high=0x7F),
        ProfileKey("channel", "whole", low=0, high=15),
        ProfileKey("output_enable", "pin", NO_PIN),
    ),
    "lgpio": (ProfileKey("pin", "pin"),),
    "sysfs": (
        ProfileKey("chip", "whole", 0, low=0, high=99),
        ProfileKey("channel", "whole", low=0, high=15),
    ),
}
"""Keys of each pulse source of a servo or a controller."""

SENSOR_KEYS: Final = (ProfileKey("driver", "choice", names=tuple(SENSOR_DRIVERS)),)

SENSOR_SETTINGS: Final = {
    "encoder": (
        ProfileKey("a", "pin"),
        ProfileKey("b", "pin", NO_PIN),
        ProfileKey("counts_per_turn", "number", low=0.0, high=1e6, above=True),
        ProfileKey("wheel_m", "number", low=0.0, high=100.0, above=True),
    ),
    "switch": (
        ProfileKey("pins", "pins"),
        ProfileKey("pull", "choice", "up", names=("up", "down")),
    ),
    "hcsr04": (
        ProfileKey("trigger", "pin"),
        ProfileKey("echo", "pin"),
        ProfileKey("max_m", "number", 2.0, low=0.0, high=5.0, above=True),
    ),
    "mpu6050": (_BUS, ProfileKey("address", "whole", 0x68, low=0x68, high=0x69)),
    "ina219": (_BUS, ProfileKey("address", "whole", 0x40, low=0x40, high=0x4F)),
    "cpu_temperature": (
        ProfileKey("path", "text", "/sys/class/thermal/thermal_zone0/temp", longest=4096),
    ),
    "bus_servo": (),
    "as5600": (_BUS, ProfileKey("mux", "whole", 0x70, low=0x70, high=0x77)),
}
"""Keys of each sensor driver."""

JOINT_KEYS: Final = (
    ProfileKey("channel", "whole", low=0, high=7),
    # Counts of 1/4096 turn with a straight joint.
    ProfileKey("zero", "whole", 0, low=0, high=4095),
    ProfileKey("direction", "whole", 1, low=-1, high=1),
)
"""Keys of each joint of an as5600 sensor, which has a table of its own."""

CAMERA_KEYS: Final = (
    ProfileKey("driver", "choice", names=tuple(CAMERA_DRIVERS)),
    ProfileKey("size", "size", (160, 120), low=16, high=1920),
    ProfileKey("fps", "number", 20.0, low=1.0, high=120.0),
    ProfileKey("jpeg_quality", "whole", 80, low=1, high=100),
    ProfileKey("flip", "truth", False),
    ProfileKey("pitch_deg", "number", None, low=-45.0, high=45.0),
    ProfileKey("fovy_deg", "number", None, low=10.0, high=170.0),
)

CAMERA_SETTINGS: Final = {
    "picamera2": (ProfileKey("number", "whole", 0, low=0, high=9),),
    "v4l2": (ProfileKey("device", "text", "/dev/video0", longest=4096),),
    "file": (ProfileKey("path", "text", longest=4096),),
    "pipe": (ProfileKey("path", "text", longest=4096),),
    "pattern": (),
}
"""Keys of each camera driver."""

LIMIT_KEYS: Final = (
    ProfileKey("deadline_ms", "whole", 250, low=20, high=1000),
    ProfileKey("camera_stale_ms", "whole", None, low=50, high=5000),
    ProfileKey("bump_hold_ms", "whole", 750, low=0, high=60_000),
    ProfileKey("stop_distance_m", "number", 0.0, low=0.0, high=5.0),
    ProfileKey("stall_s", "number", 0.4, low=0.0, high=10.0),
    ProfileKey("stall_throttle", "number", 0.2, low=0.0, high=1.0, above=True),
    ProfileKey("low_battery_v", "number", 0.0, low=0.0, high=100.0),
    ProfileKey("high_temperature_c", "number", 0.0, low=0.0, high=120.0),
    ProfileKey("max_observation_age_ms", "whole", 400, low=20, high=5000),
    ProfileKey("arming", "choice", "person", names=("person", "anyone")),
)

STOP_KEYS: Final = (
    ProfileKey("hold_ms", "whole", 0, low=0, high=10_000),
    ProfileKey("ramp_ms", "whole", 0, low=0, high=10_000),
    ProfileKey("then", "choice", "hold", names=("hold", "release")),
)

REWARD_KEYS: Final = (
    ProfileKey("velocity", "number", 1.0, low=0.0, high=1e6),
    ProfileKey("collision", "number", -10.0, low=-1e6, high=0.0),
    ProfileKey("stall", "number", -1.0, low=-1e6, high=0.0),
    ProfileKey("collision_ends_episode", "truth", True),
)

RESET_KEYS: Final = (
    ProfileKey("values", "weights", low=-1.0, high=1.0),
    ProfileKey("seconds", "number", low=0.0, high=60.0, above=True),
)

ENABLE_KEYS: Final = (
    ProfileKey("pin", "pin"),
    # The guard toggles the pin at each tick, every 10 ms, and may be a few ms late.
    ProfileKey("hold_ms", "whole", 100, low=30, high=1000),
)

SERVO_BUS_KEYS: Final = (
    ProfileKey("device", "text", "/dev/ttyUSB0", longest=4096),
    ProfileKey("baud", "whole", 1_000_000, low=9600, high=4_500_000),
    # The watchdog of Dynamixel servos has steps of 20 ms; others have none.
    ProfileKey("watchdog_ms", "whole", 100, low=20, high=2540),
    ProfileKey("ramp_ms", "whole", 300, low=0, high=10_000),
    # One silent servo must delay the guard by less than the limit for sensors.
    ProfileKey("answer_ms", "number", 3.0, low=0.1, high=100.0),
)
"""Keys of the bus of the outputs with the driver bus_servo."""

EMERGENCY_BUTTON_KEYS: Final = (ProfileKey("pin", "pin"),)

_Owners = Mapping[str, Mapping[str, Iterable[ProfileKey]]]
_NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,31}")


class Section:
    """One table of a profile and its path, so that a mistake in it can be located.

    Every method raises a `ProfileError` with one sentence and the line.

    Args:
        source: Where the profile was read.
        place: Path of the table.
        table: Its keys and nested tables; anything else is refused.
    """

    def __init__(self, source: Source, place: Place, table: Any) -> None:
        self.source = source
        self.place = place
        if not isinstance(table, dict):
            raise self.mistake(f"{self} must be a table, not {shown(table)}")
        self.table = cast("dict[str, Any]", table)

    def __str__(self) -> str:
        return called(self.place)

    def __contains__(self, name: str) -> bool:
        return name in self.table

    def mistake(self, words: str, *at: str | int) -> ProfileError:
        """Return the error for a mistake in this table, or in one of its keys.

        Args:
            words: What is wrong, without the place.
            at: Keys and indices from this table to the mistake.
        """
        return self.source.mistake((*self.place, *at), words)

    def section(self, name: str) -> Section:
        """Return a nested table, which is empty if it is missing."""
        return Section(self.source, (*self.place, name), self.table.get(name, {}))

    def named(self) -> dict[str, Section]:
        """Return the nested tables by name; refuse names that are not allowed for a part."""
        for name in self.table:
            if _NAME.fullmatch(name) is None:
                words = "must begin with a letter and have at most 32 letters, digits, '_' and '-'"
                raise self.mistake(f"the name {name!r} {words}", name)
        return {name: self.section(name) for name in self.table}

    def read(self, keys: Iterable[ProfileKey], owners: _Owners | None = None) -> dict[str, Any]:
        """Return the value of each key, with defaults, and refuse unknown keys.

        Args:
            keys: The permitted keys.
            owners: Keys of other drivers, by what these are called and by driver.
        """
        known = {key.name: key for key in keys}
        for name in self.table:
            if name in known:
                continue
            if (meant := with_unit(name, known)) is not None:
                words = f"{name!r} of {self} lacks its unit or has another one: write {meant!r}"
                raise self.mistake(f"{words} ({unit_of(meant)})", name)
            for kind, drivers in (owners or {}).items():
                if having := [d for d, ks in drivers.items() if name in (k.name for k in ks)]:
                    words = f"{name!r} belongs to {kind} {' and '.join(having)}, not to {self}"
                    raise self.mistake(words, name)
            raise self.mistake(f"{self} has no key {choice(name, known)}", name)
        return {name: self.value(key) for name, key in known.items()}

    def value(self, key: ProfileKey) -> Any:
        """Return the value of one key, or its default."""
        if key.name not in self.table:
            if key.default is REQUIRED:
                raise self.mistake(f"{self} lacks the key {key.name!r}, {key.wanted}")
            return key.default
        try:
            return key.value_of(self.table[key.name])
        except ValueError as error:
            words = f"{key.name} of {self} must be {key.wanted}, {error}"
            raise self.mistake(words, key.name) from None
