"""Profiles of robots for tests on a twin."""

from __future__ import annotations

from pathlib import Path

from shapechanger.robot.profile.load import load_profile
from shapechanger.robot.profile.profile import Profile

IN_A_ROOM = ("--world", "room")
"""Arguments for a twin in the room, which starts fastest."""

CAR = """\
# The car of 2017, with all protective sensors.

[robot]
name = "test-car"
body = "car"
control_hz = 20

[action.steering]
levels = "three"
threshold = 0.33

[action.throttle]
propels = true
slew_per_s = 8.0

[output.drive]
driver = "hbridge"
part = "wheels"
forward = 22
backward = 27
mix = { throttle = 0.6 }

[output.steer]
driver = "hbridge"
part = "steering"
forward = 4
backward = 17
mix = { steering = 0.4 }

[sensor.wheel]
driver = "encoder"
a = 5
b = 6
counts_per_turn = 20
wheel_m = 0.21

[sensor.bumper]
driver = "switch"
pins = [13, 12]

[sensor.front]
driver = "hcsr04"
trigger = 23
echo = 24

[sensor.pack]
driver = "ina219"

[camera]
driver = "picamera2"
size = [160, 120]
fps = 20

[limits]
deadline_ms = 250
camera_stale_ms = 500
low_battery_v = 6.6

[reward]
velocity = 1.0
collision = -10.0
stall = -1.0

[enable]
pin = 19

[emergency_button]
pin = 21
"""
"""A car with an encoder, a bumper, a distance sensor, a one-shot and an emergency button."""


def changed(old: str, new: str, text: str = CAR) -> str:
    """Return the text with the only occurrence of `old` replaced."""
    assert text.count(old) == 1, old
    return text.replace(old, new)


PATIENT_CAR = changed("deadline_ms = 250", "deadline_ms = 1000")
"""The car with a long deadline, for tests in real time that do not check deadlines.

A guard that is silent for the deadline is killed, and a busy machine can delay it by 250 ms.
"""


def write_profile(folder: Path, text: str = CAR) -> Profile:
    """Write a profile to a new file and load it."""
    name = next(line for line in text.splitlines() if line.startswith("name = "))
    path = folder / f"{name.split(chr(34))[1]}.toml"
    path.write_text(text)
    return load_profile(path)


BLIND_CAR = """\
# A car without any sensor.

[robot]
name = "blind-car"
body = "car"
control_hz = 20

[action.steering]

[action.throttle]
propels = true

[output.drive]
driver = "hbridge"
part = "wheels"
forward = 22
backward = 27
mix = { throttle = 1.0 }

[output.steer]
driver = "hbridge"
part = "steering"
forward = 4
backward = 17
mix = { steering = 1.0 }

[limits]
deadline_ms = 1000
"""
