"""Delays of the machine's scheduler, which tests of promised times add to them."""

import subprocess
import sys
from typing import Literal

MARGIN_MS = 5.0
"""Margin on the promised time of a stop, which includes the guard's tick of 10 ms.

The ledger and the times of faults use the same clock, CLOCK_MONOTONIC. A fault gets its time just
before it happens, and a level when its process sends it to the board, which adds far less than
1 ms. A fault that the board itself makes gets its time when the board reports it to the guard.
"""

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
