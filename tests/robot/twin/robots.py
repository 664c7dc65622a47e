"""Plans of small robots, and helpers that run processes and wait for conditions."""

import math
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from shapechanger.contract.plan import ActionPlan, GuardPlan, OutputPlan, SensorPlan

ACTIONS = (ActionPlan("steering"), ActionPlan("throttle", propels=True))


def hbridge(
    name: str, part: str, pins: tuple[int, int], mix: dict[str, float], start: float = 0.0
) -> OutputPlan:
    settings = {"forward": pins[0], "backward": pins[1], "enable": -1, "pwm_hz": 50}
    return OutputPlan(name, "hbridge", part, mix, 0.0, {**settings, "start": start, "full": 1.0})


def servo(
    name: str, part: str, mix: dict[str, float], **over: bool | int | float | str
) -> OutputPlan:
    settings = {"hz": 50, "left_us": 1000, "centre_us": 1500, "right_us": 2000}
    more = {"travel_deg_per_s": math.inf}
    return OutputPlan(name, "servo", part, mix, 0.0, {**settings, **more, **over})


def esc(
    name: str, part: str, mix: dict[str, float], **over: bool | int | float | str
) -> OutputPlan:
    settings = {"hz": 50, "backward_us": 1000, "neutral_us": 1500, "forward_us": 2000}
    more = {"arm_s": 0.5, "reverse": "double", "brake_ms": 100}
    return OutputPlan(name, "esc", part, mix, 0.0, {**settings, **more, **over})


DRIVE = hbridge("drive", "wheels", (22, 27), {"throttle": 1.0})
STEER = hbridge("steer", "steering", (17, 4), {"steering": 1.0})
ENCODER = SensorPlan(
    "wheel", "encoder", "speed", {"a": 5, "b": 6, "counts_per_turn": 20, "wheel_m": 0.2}
)
BUMPER = SensorPlan("bumper", "switch", "bump", {"pins": [13], "pull": "up"})
CAR = GuardPlan("car", ACTIONS, (DRIVE, STEER), (ENCODER, BUMPER), enable_pin=25, stop_pin=26)


@contextmanager
def process(code: str, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Start a Python process, wait for its first line of output, and kill it on exit."""
    command = [sys.executable, "-c", code, *arguments]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as run:
        try:
            assert run.stdout is not None
            assert run.stdout.readline(), "the process ended before it was ready"
            yield run
        finally:
            run.kill()


def until(condition: Callable[[], bool], seconds: float = 10.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not happen in time"
        time.sleep(0.005)
