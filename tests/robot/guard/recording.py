"""Hardware that appends each change of a pin to a file, for tests with real processes.

The argument of `connect` is the file. Each line is a JSON object with the change (`pin`, `duty`),
the process (`pid`) and the time (`t`, CLOCK_MONOTONIC in ns). Processes do not share pin state, so
the last line of a pin gives its level after a process died, as on a Raspberry Pi.
"""

import json
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from gpiozero.pins.mock import MockFactory, MockPWMPin

from shapechanger.robot.hardware import Clock

_STUCK = "stuck-"
"""Prefix of a file next to the record that makes a pin fail, such as `stuck-GPIO22`."""


class Record:
    """Reader and writer of the file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def write(self, **fields: object) -> None:
        """Add a line; several processes may do so at once."""
        line = json.dumps({"t": time.monotonic_ns(), "pid": os.getpid(), **fields}) + "\n"
        fd = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        os.write(fd, line.encode())
        os.close(fd)

    def lines(self) -> list[dict[str, Any]]:
        """Return all complete lines."""
        if not self.path.exists():
            return []
        text = self.path.read_text()
        return [json.loads(line) for line in text[: text.rfind("\n") + 1].splitlines()]

    def pins(self) -> Iterator[dict[str, Any]]:
        return (line for line in self.lines() if "pin" in line)

    def is_at_rest(self) -> bool:
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

        self.clock = Clock()
        self._factory = MockFactory(pin_class=Pin)

    def pin_factory(self) -> MockFactory:
        return self._factory

    def close(self) -> None:
        """Do nothing: pins keep their level."""


def connect(path: str) -> _Hardware:
    """Connect recorded pins; the argument is the file."""
    record = Record(Path(path))
    record.write(opened="hardware")
    return _Hardware(record)
