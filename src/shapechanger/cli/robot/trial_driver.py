"""Program that drives at full throttle in a separate process.

It is started by path, reads the robot's address from standard input, and prints the time of each
sent command on a line: monotonic, ns.
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

_STARTED_S: Final = 30.0


class Driver:
    """The driving process.

    Args:
        robot: The robot.
        within: Command prefix, such as one that enters a network namespace.
    """

    def __init__(self, robot: KnownRobot, within: Sequence[str] = ()) -> None:
        self.process = subprocess.Popen(
            # By path, so that the command line is not imported.
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
        """Return the driver."""
        return self

    def __exit__(self, *_: object) -> None:
        """End it."""
        self.close()

    @property
    def sent(self) -> list[int]:
        """Return the time of each sent command, ns."""
        return list(self._sent)

    def await_commands(self, count: int) -> None:
        """Wait until it has sent `count` commands.

        Raises:
            RobotError: If it ends before, or takes too long.
        """
        until_s = time.monotonic() + _STARTED_S
        while len(self._sent) < count:
            if self.process.poll() is not None or time.monotonic() > until_s:
                self.close()
                raise RobotError(f"The driver did not drive: {self._words.strip()}")
            time.sleep(0.002)

    def close(self) -> None:
        """Kill it."""
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
            # Printed before it is sent, so that a kill in between cannot hide a command.
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
