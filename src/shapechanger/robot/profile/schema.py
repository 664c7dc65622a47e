"""Every table of a profile and every key that it may have."""

from __future__ import annotations

import math
from typing import Final

from shapechanger.robot.cameras.camera import CAMERA_DRIVERS
from shapechanger.robot.drivers.dynamixel.models import MODELS
from shapechanger.robot.drivers.output import OUTPUT_DRIVERS
from shapechanger.robot.drivers.sensor import SENSOR_DRIVERS
from shapechanger.robot.profile.keys import NO_PIN, Key

__all__ = [
    "ACTION_KEYS",
    "CAMERA_KEYS",
    "CAMERA_SETTINGS",
    "DRIVING_PARTS",
    "EMERGENCY_BUTTON_KEYS",
    "ENABLE_KEYS",
    "JOINT_KEYS",
    "LIMIT_KEYS",
    "MEASURES",
    "OUTPUT_KEYS",
    "OUTPUT_SETTINGS",
    "OVER",
    "OVER_SETTINGS",
    "PARTS",
    "RESET_KEYS",
    "REWARD_KEYS",
    "ROBOT_KEYS",
    "SENSOR_KEYS",
    "SENSOR_SETTINGS",
    "SERVO_BUS_KEYS",
    "STOP_KEYS",
    "TABLES",
]

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
"""The tables of a profile; `action`, `output` and `sensor` hold one table for each name."""

DRIVING_PARTS: Final = (
    "wheels",
    "left track",
    "right track",
    "propeller",
    "left propeller",
    "right propeller",
)
"""Parts that make the robot go."""

PARTS: Final = (*DRIVING_PARTS, "steering", "rudder", "gear", "bed", "joint", "tendon")
"""Parts that an output may move."""

OVER: Final = ("pca9685", "lgpio", "sysfs")
"""What may make the pulses of a servo or a controller."""

MEASURES: Final = {
    "encoder": "speed",
    "switch": "bump",
    "hcsr04": "distance",
    "mpu6050": "imu",
    "ina219": "battery",
    "cpu_temperature": "temperature",
    "dynamixel": "tendons",
    "as5600": "joints",
}
"""What each sensor driver measures, as in `SensorPlan.measures`."""

ROBOT_KEYS: Final = (
    Key("name", "text"),
    Key("body", "text"),
    Key("control_hz", "number", 20.0, low=1.0, high=100.0),
    Key("calibrated", "date", None),
)

ACTION_KEYS: Final = (
    Key("low", "number", None, low=-1.0, high=1.0),
    Key("high", "number", 1.0, low=-1.0, high=1.0),
    Key("rest", "number", 0.0, low=-1.0, high=1.0),
    Key("slew_per_s", "number", math.inf, low=0.0, above=True),
    Key("levels", "choice", "any", names=("any", "three")),
    Key("threshold", "number", 0.33, low=0.0, high=1.0, above=True),
    Key("propels", "truth", False),
    Key("one_sided", "truth", False),
    Key("unit", "choice", "1", names=("1", "deg", "rad", "m", "m/s", "N", "N·m")),
    Key("gain", "number", 1.0, low=0.0, high=1e6, above=True),
)

OUTPUT_KEYS: Final = (
    Key("driver", "choice", names=tuple(OUTPUT_DRIVERS)),
    Key("part", "choice", "", names=("", *PARTS)),
    Key("mix", "weights", low=-10.0, high=10.0),
    Key("offset", "number", 0.0, low=-1.0, high=1.0),
)

_BUS: Final = Key("bus", "whole", 1, low=0, high=99)
_PULSES: Final = (
    Key("over", "choice", names=OVER),
    Key("hz", "whole", 50, low=40, high=400),
)
_DUTY: Final = (
    # gpiozero's software PWM takes up to 10 kHz.
    Key("pwm_hz", "whole", 50, low=1, high=10_000),
    Key("start", "number", 0.0, low=0.0, high=1.0),
    Key("full", "number", 1.0, low=0.0, high=1.0, above=True),
)


def _width(name: str, default: int) -> Key:
    # The widths that lgpio.tx_servo takes; servos and controllers know no others.
    return Key(name, "whole", default, low=500, high=2500)


OUTPUT_SETTINGS: Final = {
    "hbridge": (
        Key("forward", "pin"),
        Key("backward", "pin"),
        Key("enable", "pin", NO_PIN),
        *_DUTY,
    ),
    "phase_enable": (Key("phase", "pin"), Key("enable", "pin"), *_DUTY),
    "servo": (
        *_PULSES,
        _width("left_us", 1000),
        _width("centre_us", 1500),
        _width("right_us", 2000),
        Key("travel_deg_per_s", "number", math.inf, low=0.0, above=True),
    ),
    "esc": (
        *_PULSES,
        _width("backward_us", 1000),
        _width("neutral_us", 1500),
        _width("forward_us", 2000),
        Key("arm_s", "number", 2.5, low=0.0, high=30.0),
        Key("reverse", "choice", "direct", names=("direct", "double", "none")),
        Key("brake_ms", "whole", 200, low=0, high=2000),
    ),
    "dynamixel": (
        Key("id", "whole", low=0, high=252),
        Key("model", "choice", names=tuple(MODELS)),
        Key("spool_radius_m", "number", low=0.0, high=0.1, above=True),
        Key("direction", "whole", 1, low=-1, high=1),
        Key("most_tension_n", "number", low=0.0, high=1000.0, above=True),
        Key("pretension_n", "number", low=0.0, high=1000.0, above=True),
        Key("homing_n", "number", 3.0, low=0.0, high=1000.0, above=True),
        # Where the servo stands while the finger is straight, in counts of 1/4096 turn.
        Key("zero", "whole", 0, low=-1_000_000, high=1_000_000),
    ),
}
"""Keys of each output driver, besides those of what it goes `over`."""

OVER_SETTINGS: Final = {
    "pca9685": (
        _BUS,
        Key("address", "whole", 0x40, low=0x40, high=0x7F),
        Key("channel", "whole", low=0, high=15),
        Key("output_enable", "pin", NO_PIN),
    ),
    "lgpio": (Key("pin", "pin"),),
    "sysfs": (
        Key("chip", "whole", 0, low=0, high=99),
        Key("channel", "whole", low=0, high=15),
    ),
}
"""Keys that a servo or a controller has for what makes its pulses."""

SENSOR_KEYS: Final = (Key("driver", "choice", names=tuple(SENSOR_DRIVERS)),)

SENSOR_SETTINGS: Final = {
    "encoder": (
        Key("a", "pin"),
        Key("b", "pin", NO_PIN),
        Key("counts_per_turn", "number", low=0.0, high=1e6, above=True),
        Key("wheel_m", "number", low=0.0, high=100.0, above=True),
    ),
    "switch": (
        Key("pins", "pins"),
        Key("pull", "choice", "up", names=("up", "down")),
    ),
    "hcsr04": (
        Key("trigger", "pin"),
        Key("echo", "pin"),
        Key("max_m", "number", 2.0, low=0.0, high=5.0, above=True),
    ),
    "mpu6050": (_BUS, Key("address", "whole", 0x68, low=0x68, high=0x69)),
    "ina219": (_BUS, Key("address", "whole", 0x40, low=0x40, high=0x4F)),
    "cpu_temperature": (
        Key("path", "text", "/sys/class/thermal/thermal_zone0/temp", longest=4096),
    ),
    "dynamixel": (),
    "as5600": (_BUS, Key("mux", "whole", 0x70, low=0x70, high=0x77)),
}
"""Keys of each sensor driver."""

JOINT_KEYS: Final = (
    Key("channel", "whole", low=0, high=7),
    # Counts of 1/4096 turn while the joint is straight.
    Key("zero", "whole", 0, low=0, high=4095),
    Key("direction", "whole", 1, low=-1, high=1),
)
"""Keys of each joint of a sensor with the driver as5600; each is a table of its own in it."""

CAMERA_KEYS: Final = (
    Key("driver", "choice", names=tuple(CAMERA_DRIVERS)),
    Key("size", "size", (160, 120), low=16, high=1920),
    Key("fps", "number", 20.0, low=1.0, high=120.0),
    Key("jpeg_quality", "whole", 80, low=1, high=100),
    Key("flip", "truth", False),
)

CAMERA_SETTINGS: Final = {
    "picamera2": (Key("number", "whole", 0, low=0, high=9),),
    "v4l2": (Key("device", "text", "/dev/video0", longest=4096),),
    "file": (Key("path", "text", longest=4096),),
    "pipe": (Key("path", "text", longest=4096),),
    "pattern": (),
}
"""Keys of each camera driver."""

LIMIT_KEYS: Final = (
    Key("deadline_ms", "whole", 250, low=20, high=1000),
    Key("camera_stale_ms", "whole", None, low=50, high=5000),
    Key("bump_hold_ms", "whole", 750, low=0, high=60_000),
    Key("stop_distance_m", "number", 0.0, low=0.0, high=5.0),
    Key("stall_s", "number", 0.4, low=0.0, high=10.0),
    Key("stall_throttle", "number", 0.2, low=0.0, high=1.0, above=True),
    Key("low_battery_v", "number", 0.0, low=0.0, high=100.0),
    Key("high_temperature_c", "number", 0.0, low=0.0, high=120.0),
    Key("max_observation_age_ms", "whole", 400, low=20, high=5000),
    Key("arming", "choice", "person", names=("person", "anyone")),
)

STOP_KEYS: Final = (
    Key("hold_ms", "whole", 0, low=0, high=10_000),
    Key("ramp_ms", "whole", 0, low=0, high=10_000),
    Key("then", "choice", "hold", names=("hold", "release")),
)

REWARD_KEYS: Final = (
    Key("velocity", "number", 1.0, low=0.0, high=1e6),
    Key("collision", "number", -10.0, low=-1e6, high=0.0),
    Key("stall", "number", -1.0, low=-1e6, high=0.0),
    Key("collision_ends_episode", "truth", True),
)

RESET_KEYS: Final = (
    Key("values", "weights", low=-1.0, high=1.0),
    Key("seconds", "number", low=0.0, high=60.0, above=True),
)

ENABLE_KEYS: Final = (
    Key("pin", "pin"),
    # The guard toggles the pin at each of its ticks, 10 ms apart; it may be late by some.
    Key("hold_ms", "whole", 100, low=30, high=1000),
)

SERVO_BUS_KEYS: Final = (
    Key("device", "text", "/dev/ttyUSB0", longest=4096),
    Key("baud", "whole", 1_000_000, low=9600, high=4_500_000),
    # The watchdog of the servos counts in steps of 20 ms.
    Key("watchdog_ms", "whole", 100, low=20, high=2540),
    Key("ramp_ms", "whole", 300, low=0, high=10_000),
    # So that one servo that is silent keeps the guard for less than it lets a sensor take.
    Key("answer_ms", "number", 3.0, low=0.0, high=100.0, above=True),
)
"""What the outputs with the driver dynamixel are on."""

EMERGENCY_BUTTON_KEYS: Final = (Key("pin", "pin"),)
