"""Hardware that writes every change of a pin to a file, for tests with real processes.

Its argument is the file. Each line is a JSON object: what (`pin`, `duty`), who (`pid`) and when
(`t`, CLOCK_MONOTONIC in ns). Pins of different processes know nothing of each other; so, as on a
Raspberry Pi, what a process left is what its last line says.
"""

import json
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from gpiozero.pins.mock import MockFactory, MockPWMPin

from shapechanger.robot.hardware import RealClock

_STUCK = "stuck-"
"""Begins the name of a file that makes a pin fail: `stuck-22` beside the record."""


class Record:
    """The file, for those who write and those who read."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def write(self, **fields: object) -> None:
        """Add a line; several processes may do so at once."""
        line = json.dumps({"t": time.monotonic_ns(), "pid": os.getpid(), **fields}) + "\n"
        fd = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        os.write(fd, line.encode())
        os.close(fd)

    def lines(self) -> list[dict[str, Any]]:
        """All complete lines."""
        if not self.path.exists():
            return []
        text = self.path.read_text()
        return [json.loads(line) for line in text[: text.rfind("\n") + 1].splitlines()]

    def pins(self) -> Iterator[dict[str, Any]]:
        """The lines of pins."""
        return (line for line in self.lines() if "pin" in line)

    def is_at_rest(self) -> bool:
        """Whether every pin was low last."""
        return not any({line["pin"]: line["duty"] for line in self.pins()}.values())


class _Hardware:
    """Recorded pins on the machine's clock."""

    def __init__(self, record: Record) -> None:
        class Pin(MockPWMPin):
            def _set_function(self, value: str) -> None:
                super()._set_function(value)
                if value == "output":
                    record.write(pin=self.info.name, duty=0.0)

            def _set_state(self, value: float) -> None:
                if (record.path.parent / f"{_STUCK}{self.info.name}").exists():
                    raise OSError(f"{self.info.name} is stuck")
                super()._set_state(value)
                record.write(pin=self.info.name, duty=float(value))

        self.clock = RealClock()
        self._factory = MockFactory(pin_class=Pin)

    def pin_factory(self) -> MockFactory:
        """Mock pins that write."""
        return self._factory

    def close(self) -> None:
        """Let go of the pins; they keep their level."""


def connect(path: str) -> _Hardware:
    """Recorded pins; the argument is the file."""
    record = Record(Path(path))
    record.write(opened="hardware")
    return _Hardware(record)
