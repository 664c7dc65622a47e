"""A program that drives at full throttle until it is stopped, in a process of its own.

It is started by path, reads from its standard input where the robot is, and writes each command
that it has sent to its standard output: the time, in nanoseconds of the machine's monotonic clock,
on a line of its own.
"""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from dataclasses import asdict
from typing import Final, Self

import msgspec

from shapechanger.errors import LinkError, RobotError
from shapechanger.layout import Layout
from shapechanger.remote.client import RobotClient
from shapechanger.remote.known_robots import KnownRobot

__all__ = ["Driver", "main"]

_STARTED_S: Final = 30.0


class Driver:
    """A process that drives.

    Args:
        robot: The robot.
        within: The command that starts it elsewhere, such as in another network namespace.
    """

    def __init__(self, robot: KnownRobot, within: Sequence[str] = ()) -> None:
        self.process = subprocess.Popen(
            # By path, so that it loads nothing of the command line.
            [*within, sys.executable, "-P", __file__],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        self._sent: list[int] = []
        self._words = ""
        self._readers = [
            threading.Thread(target=self._read_commands, daemon=True),
            threading.Thread(target=self._read_words, daemon=True),
        ]
        if self.process.stdin is not None:
            self.process.stdin.write(msgspec.json.encode(asdict(robot)))
            self.process.stdin.close()
        for reader in self._readers:
            reader.start()

    def __enter__(self) -> Self:
        """The driver itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """End it."""
        self.close()

    @property
    def sent(self) -> list[int]:
        """When it sent each command so far, ns."""
        return list(self._sent)

    def await_commands(self, count: int) -> None:
        """Wait until it has sent so many.

        Raises:
            RobotError: If it ends before, or does not get that far.
        """
        until_s = time.monotonic() + _STARTED_S
        while len(self._sent) < count:
            if self.process.poll() is not None or time.monotonic() > until_s:
                self.close()
                raise RobotError(f"The driver did not drive: {self._words.strip()}")
            time.sleep(0.002)

    def close(self) -> None:
        """End it without any farewell."""
        self.process.kill()
        self.process.wait()
        for reader in self._readers:
            reader.join()
        for stream in (self.process.stdout, self.process.stderr):
            if stream is not None:
                stream.close()

    def _read_commands(self) -> None:
        if self.process.stdout is not None:
            for line in self.process.stdout:
                if line.endswith(b"\n"):
                    self._sent.append(int(line))

    def _read_words(self) -> None:
        if self.process.stderr is not None:
            self._words = self.process.stderr.read().decode(errors="replace")


def main() -> None:
    """Drive until the link or this process ends."""
    robot = KnownRobot(**msgspec.json.decode(sys.stdin.buffer.read()))
    with RobotClient.connect(robot) as client:
        values = [float(name == "throttle") for name in _names(client)]
        client.take()
        client.arm()
        client.acknowledge()
        seq = 0
        while True:
            seq = client.observation(seq).message.seq
            # Written before it is sent: a kill in between must not hide a command.
            sys.stdout.write(f"{time.monotonic_ns()}\n")
            sys.stdout.flush()
            client.command(values, answers=seq)


def _names(client: RobotClient) -> tuple[str, ...]:
    return Layout.from_json(client.welcome.action_layout).names


if __name__ == "__main__":
    try:
        main()
    except LinkError as error:
        sys.exit(str(error))
