"""The robot stops in time after each fault, judged by the ledger of a twin."""

import contextlib
import subprocess
import sys
from collections.abc import Iterator
from typing import Literal

import pytest

from shapechanger.robot.twin.check.faults import FAULTS
from shapechanger.robot.twin.check.trial import Bench, run_trials
from tests.robots import write_profile

pytestmark = [pytest.mark.realtime, pytest.mark.system]

MARGIN_MS = 5.0
"""Margin on the promised time of a stop, which includes the guard's tick of 10 ms.

The ledger and the times of faults use the same clock, CLOCK_MONOTONIC. A fault gets its time just
before it happens, and a level when its process sends it to the board, which adds far less than
1 ms. A fault that the board itself makes gets its time when the board reports it to the guard.
"""

TRIALS = 2
PILOT = "shapechanger.vehicles.remote.full_throttle"

# Sleeps for 1 ms at a time; for each line of input, it prints its longest delay, ms.
_WITNESS = """
import select, sys, time
from shapechanger.robot.guard.running import GUARD, run_promptly
if sys.argv[1] == "guard":
    run_promptly(GUARD)
longest_s, before_s = 0.0, time.monotonic()
while True:
    asked = select.select([sys.stdin], [], [], 1e-3)[0]
    now_s = time.monotonic()
    longest_s, before_s = max(longest_s, now_s - before_s - 1e-3), now_s
    if asked:
        if not sys.stdin.readline():
            break
        print(1e3 * longest_s, flush=True)
        longest_s = 0.0
"""


class Witness:
    """A process that measures how long this machine keeps a process of some priority waiting.

    A robot cannot stop in time while its machine does not run it. The promise is about the robot,
    so the test adds this delay to the promised time, instead of a factor for the worst machine.
    """

    def __init__(self, priority: Literal["guard", "normal"]) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-c", _WITNESS, priority],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def longest_ms(self) -> float:
        """Return the longest delay since the last call, ms."""
        stdin, stdout = self._process.stdin, self._process.stdout
        assert stdin is not None
        assert stdout is not None
        stdin.write("\n")
        stdin.flush()
        return float(stdout.readline())

    def close(self) -> None:
        self._process.communicate()


@pytest.fixture(scope="module")
def guards_witness() -> Iterator[Witness]:
    """A witness of the delays of the guard, which switches the outputs."""
    with contextlib.closing(Witness("guard")) as made:
        yield made


@pytest.fixture(scope="module")
def daemons_witness() -> Iterator[Witness]:
    """A witness of the delays of the daemon, which passes commands to the guard."""
    with contextlib.closing(Witness("normal")) as made:
        yield made


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    """A robot for all faults, replaced when a fault ends it."""
    profile = write_profile(tmp_path_factory.mktemp("faults"))
    with contextlib.closing(Bench(profile, pilot=PILOT)) as made:
        yield made


@pytest.mark.parametrize("name", FAULTS)
def test_the_robot_stops(
    bench: Bench, guards_witness: Witness, daemons_witness: Witness, name: str
) -> None:
    """The stop is within the promised time, and the robot never drives without a fresh command."""
    drove = 0
    guards_witness.longest_ms()
    daemons_witness.longest_ms()
    for result in run_trials(bench, FAULTS[name], TRIALS):
        margin_ms = MARGIN_MS + guards_witness.longest_ms()
        drove += result.drove
        assert result.stopped_ms <= result.limit_ms + margin_ms, result
        # An output may be as late as a stop after the deadline of the last command, which begins
        # when the daemon reads the command.
        margin_ms += daemons_witness.longest_ms()
        late_ms = [(i.end_ns - i.start_ns) / 1e6 for i in result.unauthorised]
        assert sum(late_ms) <= margin_ms, result
    assert drove == TRIALS
