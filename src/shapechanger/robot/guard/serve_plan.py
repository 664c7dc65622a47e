"""Plan for the processes of a robot, passed on as an open file.

The command line checks a profile once, turns it into this plan and starts the supervisor with it.
The file is anonymous, so that nothing is left behind; sealed, so that no process can change it; and
in memory, so that a full disk does not keep a robot from starting.
"""

from __future__ import annotations

import fcntl
import json
import os
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import msgspec

from shapechanger.contract.plan import GuardPlan
from shapechanger.robot.guard import start
from shapechanger.robot.hardware import REAL

_DAEMON_SILENCE_MS: Final = 2000


@dataclass(frozen=True, slots=True)
class ServePlan:
    """Everything that supervisor, guard and daemon need.

    Attributes:
        guard: What the guard needs.
        daemon: What the daemon needs, as JSON, which the supervisor passes on.
        hardware: Factory of the hardware and its argument; see
            `shapechanger.robot.hardware.connect`.
        python: The interpreter that runs the processes.
        patience_ms: Lower bound on the silence after which guard and daemon are killed, ms; their
            own limits apply if those are longer. 0 on a robot, and on a twin in real time, whose
            guard beats while its board is held up. A twin's clock waits for a busy machine, and is
            paused while a world is drawn; a guard that waits for it is alive.
    """

    guard: GuardPlan
    daemon: dict[str, Any]
    hardware: tuple[str, str] = (REAL, "")
    python: str = sys.executable
    patience_ms: int = 0

    @property
    def guard_silence_ms(self) -> int:
        """Silence after which the guard is killed, ms."""
        return max(self.patience_ms, self.guard.limits.deadline_ms)

    @property
    def daemon_silence_ms(self) -> int:
        """Silence after which the daemon is killed, ms."""
        return max(self.patience_ms, _DAEMON_SILENCE_MS)

    def to_json(self) -> str:
        """Return the plan as JSON."""
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> ServePlan:
        """Read the output of `to_json`."""
        return msgspec.convert(json.loads(text), cls)


def plan_fd(plan: ServePlan) -> int:
    """Return an open file with the plan for child processes to inherit; close it afterwards."""
    # Without MFD_CLOEXEC, so that `exec` keeps it open.
    fd = os.memfd_create("serve-plan", os.MFD_ALLOW_SEALING)
    left = memoryview(plan.to_json().encode())
    while left:
        left = left[os.write(fd, left) :]
    # The guard reads its limits from it, which a faulty daemon must not change.
    seals = fcntl.F_SEAL_WRITE | fcntl.F_SEAL_GROW | fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_SEAL
    fcntl.fcntl(fd, fcntl.F_ADD_SEALS, seals)
    return fd


def supervisor_command(plan: ServePlan, fd: int) -> list[str]:
    """Return the command line of the supervisor."""
    script = str(Path(start.__file__).resolve())
    return [plan.python, "-I", script, "supervise", "--plan-fd", str(fd)]


def read_plan_fd(fd: int) -> ServePlan:
    """Read the plan without moving the file position, so that several processes can."""
    data = b""
    while part := os.pread(fd, 1 << 16, len(data)):
        data += part
    return ServePlan.from_json(data.decode())


AFTER_FAILURE: Final = "--after-failure"
"""Argument of a guard that replaces failed processes."""


def descriptors(arguments: Sequence[str], names: Sequence[str]) -> dict[str, int]:
    """Parse the file descriptors of a command line such as `--plan-fd 3 --heartbeat-fd 4`."""
    pairs = dict(zip(arguments[::2], arguments[1::2], strict=True))
    if sorted(pairs) != sorted(names):
        raise ValueError(f"This takes {' N '.join(names)} N, not {' '.join(arguments)}.")
    return {name: int(value) for name, value in pairs.items()}
