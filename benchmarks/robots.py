"""Round trips of the link, resources of the processes, steps at 50 Hz, and mutated messages.

Resources and steps are measured on a twin, with the programs of a Raspberry Pi; only the hardware
below the pins is simulated. Round trips are measured with `EchoRobot`.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, Literal

import gymnasium as gym
import numpy as np

from benchmarks.echo import EchoRobot
from benchmarks.row import Row
from shapechanger.robot.profile.load import load_profile
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.twin.robot import RunningRobot, run_robot
from tests.robots import CAR

ROUND_TRIPS: Final = 3_000
HOLD_S: Final = 600.0
COST_S: Final = 20.0
FUZZED: Final = 1_000_000
# Limits of resident memory, MB.
_PROCESSES: Final[dict[Literal["guard", "daemon"], int]] = {"guard": 25, "daemon": 80}


def link(round_trips: int = ROUND_TRIPS) -> list[Row]:
    """Measure the round trip of command and image, and the resources used at 20 Hz."""
    with EchoRobot() as echo:
        times = np.sort(echo.round_trips(round_trips)) * 1e3
    p50, p99 = np.percentile(times, [50, 99])
    trip = Row(
        "round trip of a command and a 160x120 JPEG over TLS",
        f"p50 {p50:.2f}, p99 {p99:.2f} ms",
        f"max {times[-1]:.2f} ms, {len(times)} round trips, an echo for guard and camera",
        "p50 < 1 ms, p99 < 5 ms",
        bool(p50 < 1.0 and p99 < 5.0),
    )
    with _driven("control_hz = 20", "fps = 20", COST_S) as (robot, drive):
        before = {name: _cpu_s(robot.pid_of(name)) for name in _PROCESSES}
        drive()
        rows = [trip]
        for name, most_mb in _PROCESSES.items():
            pid = robot.pid_of(name)
            resident_mb = _resident_mb(pid)
            share = (_cpu_s(pid) - before[name]) / COST_S
            rows.append(
                Row(
                    f"{name}, resident",
                    f"{resident_mb:.1f} MB",
                    f"after {COST_S:.0f} s of driving at 20 Hz",
                    f"< {most_mb} MB",
                    resident_mb < most_mb,
                )
            )
            rows.append(
                Row(
                    f"{name}, CPU at 20 Hz",
                    f"{100.0 * share:.1f} % of a core",
                    f"{COST_S:.0f} s, camera 160x120 at 20 pictures/s",
                    "< 15 %" if name == "daemon" else "none",
                    share < 0.15 or name != "daemon",
                )
            )
        return rows


def hold(seconds: float = HOLD_S) -> list[Row]:
    """Drive at 50 Hz for a long time and count late steps."""
    with _driven("control_hz = 50", "fps = 50", seconds) as (_, drive):
        steps, late, stopped = drive()
    return [
        Row(
            f"50 Hz for {seconds:.0f} s",
            f"{late} of {steps} steps late, {stopped} stopped by the deadline",
            f"{steps / seconds:.2f} steps/s; late is half a period after its time",
            "0 stopped, 0 late on a quiet machine",
            stopped == 0 and late == 0,
        )
    ]


def fuzz(count: int = FUZZED) -> list[Row]:
    """Send mutated messages to sessions of the daemon, in memory."""
    command = [sys.executable, "-m", "benchmarks.fuzz_link", "--count", str(count)]
    done = subprocess.run(command, capture_output=True, text=True)
    before_kb, most_kb = 0, 0
    if found := re.search(r"(\d+) kB before, (\d+) kB at most", done.stdout):
        before_kb, most_kb = int(found[1]), int(found[2])
    words = "none crashed it, none commanded"
    if done.returncode != 0:
        words = (done.stderr.strip().splitlines() or [f"ended with {done.returncode}"])[-1]
    return [
        Row(
            f"{count:,} mutated messages",
            words,
            f"memory from {before_kb} kB to at most {most_kb} kB",
            "no crash, no accepted command, memory flat",
            done.returncode == 0 and most_kb - before_kb < 1_000,
        )
    ]


@contextmanager
def _driven(
    control_hz: str, fps: str, seconds: float
) -> Generator[tuple[RunningRobot, Callable[[], tuple[int, int, int]]]]:
    """Run a robot on its twin; yield it and a function that drives it.

    The function returns the numbers of all steps, late steps and steps stopped by the deadline.
    """
    with tempfile.TemporaryDirectory() as folder:
        text = CAR.replace("control_hz = 20", control_hz).replace("fps = 20", fps)
        profile = _written(text, Path(folder) / "car.toml")
        files = Path(folder) / "robot"
        files.mkdir()
        with run_robot(profile, folder=files) as robot, robot.operator() as operator:

            def drive() -> tuple[int, int, int]:
                known = robot.known
                env: Any = gym.make(
                    "shapechanger/RemoteVehicle-v1",
                    robot=known.address,
                    key=known.key,
                    fingerprint=known.fingerprint,
                    reward={"collision_ends_episode": 0.0},
                    on_reset=operator.place,
                )
                with env:
                    env.reset(seed=0)
                    steps = late = stopped = 0
                    # Circles, so that the robot hits no wall.
                    action = np.array([1.0, 0.3], np.float32)
                    until_s = time.monotonic() + seconds
                    while time.monotonic() < until_s:
                        _, _, _, truncated, info = env.step(action)
                        steps += 1
                        late = info["deadline_missed"]  # Counted since the reset.
                        stopped += "No fresh command" in info["stop_reason"]
                        if truncated:
                            raise RuntimeError(info["truncated_because"])
                    return steps, late, stopped

            yield robot, drive


def _written(text: str, path: Path) -> Profile:
    path.write_text(text)
    return load_profile(path)


def _cpu_s(pid: int) -> float:
    """Return the CPU time of a process, s."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _resident_mb(pid: int) -> float:
    """Return the resident memory of a process, MB of 10^6 bytes."""
    status = Path(f"/proc/{pid}/status").read_text()
    (line,) = (line for line in status.splitlines() if line.startswith("VmRSS"))
    return int(line.split()[1]) * 1024 / 1e6
