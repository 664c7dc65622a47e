"""A profile with every table but `[servo_bus]`, and helpers to change it."""

import re
from pathlib import Path
from typing import Final

from shapechanger.robot.profile import Profile, read_profile, shipped_profiles

PATH = Path("rover.toml")

EVERYTHING = """\
# A rover with one of everything.
[robot]
name = "rover"
body = "car"
control_hz = 25
calibrated = 2026-11-03

[action.steering]
levels = "three"

[action.throttle]
low = -0.5
propels = true
slew_per_s = 2

[action.arm]
rest = 0.25
unit = "deg"
gain = 90

[output.drive]
driver = "hbridge"
part = "wheels"
forward = "BOARD15"
backward = "GPIO27"
enable = 26
mix = { throttle = 1 }

[output.steer]
driver = "servo"
part = "steering"
over = "pca9685"
channel = 0
left_us = 2000
right_us = 1000
mix = { steering = 0.5 }

[output.arm]
driver = "servo"
over = "pca9685"
channel = 1
output_enable = 25
mix = { arm = 1.0 }

[output.pump]
driver = "esc"
over = "sysfs"
channel = 0
mix.throttle = 0.5

[output.brush]
driver = "phase_enable"
phase = 5
enable = 6
start = 0.1
mix = { throttle = 1.0 }

[sensor.wheel]
driver = "encoder"
a = 16
b = 20
counts_per_turn = 20
wheel_m = 0.21

[sensor.bumper]
driver = "switch"
pins = [
    12,  # Left.
    "GPIO13",
]

[sensor.front]
driver = "hcsr04"
trigger = 23
echo = 24

[sensor.imu]
driver = "mpu6050"

[sensor.pack]
driver = "ina219"
address = 0x41

[sensor.chip]
driver = "cpu_temperature"

[camera]
driver = "v4l2"
size = [128, 128]
flip = true

[limits]
deadline_ms = 200
stop_distance_m = 0.3
low_battery_v = 6.6
high_temperature_c = 80
arming = "anyone"

[stop]
then = "release"

[reward]
velocity = 2
collision_ends_episode = false

[[reset]]
values = { throttle = -0.4 }
seconds = 1

[[reset]]
seconds = 0.5
[reset.values]
arm = 0.5

[enable]
pin = 19
hold_ms = 50

[emergency_button]
pin = 21
"""

_DOCS: Final = Path(__file__).parents[3] / "docs"

# The vehicle of the guide; its right rudder turns less than the left one.
(HOVERCRAFT,) = re.findall(
    r"```toml\n(\[robot\].*?)```", (_DOCS / "profiles.md").read_text(), re.DOTALL
)
HOVERCRAFT = HOVERCRAFT.replace("[output.propeller]", "[output.fan]")
HOVERCRAFT = "steering = 0.8".join(HOVERCRAFT.rsplit("steering = 1.0", 1))


def changed(old: str, new: str, text: str = EVERYTHING) -> str:
    """Return a text with its only `old` replaced; if `old` is empty, `new` is appended."""
    if not old:
        return text + new
    assert text.count(old) == 1, old
    return text.replace(old, new)


def read(text: str = EVERYTHING) -> Profile:
    return read_profile(text, PATH)


_LENGTH = 'control = "length"\nlongest_m = 0.012\nshortest_m = -0.03\n'


def finger_text(family: str) -> str:
    """Return the shipped finger with control of the lengths; for "Feetech" as in the guide."""
    text = shipped_profiles()["finger"].read_text()
    lines, enable = _LENGTH, ""
    if family == "Feetech":
        (block,) = re.findall(
            r"```toml\n\[output.FDP\]\n(.*?)```", (_DOCS / "finger-rig.md").read_text(), re.DOTALL
        )
        lines, enable = block.split("\n\n")
        for key in re.findall(r"^(\w+) =", lines, re.MULTILINE):
            text = re.sub(rf"^{key} = .*\n", "", text, flags=re.MULTILINE)
    return text.replace('part = "tendon"\n', f'part = "tendon"\n{lines}\n') + "\n" + enable
