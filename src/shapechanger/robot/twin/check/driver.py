"""Program that drives at full throttle in a separate process.

It reads a `KnownRobot` as JSON from standard input, and prints the monotonic time, ns, of each sent
command on a line. For faults of policies, a pilot replaces this program: it drives like a policy on
the robot's computer, and fails at a signal of `FAILURES`.
"""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import msgspec

from shapechanger.errors import LinkError, RobotError, translate_errors
from shapechanger.layout import Layout
from shapechanger.robot.client.client import RobotClient
from shapechanger.robot.client.known_robots import KnownRobot

_PROGRAM: Final = "shapechanger.robot.twin.check.driver"
_STARTED_S: Final = 30.0

FAILURES: Final = {
    "hangs": signal.SIGUSR1,
    "is late": signal.SIGUSR2,
    "gives NaN": signal.SIGALRM,
}
"""Signals that make a policy fail, keyed by the kind of failure."""


class Driver(subprocess.Popen[bytes]):
    """The driving process; the end of a `with` block kills it.

    It runs this program, or the module `pilot`, which drives like a policy on the robot's computer
    and needs a person who arms the robot.
    """

    def __init__(self, robot: KnownRobot, *, pilot: str = "") -> None:
        self._folder = TemporaryDirectory(prefix="shapechanger-driver-")
        # Files are used because a pipe that is not read would fill, and then block the driver.
        files = [Path(self._folder.name, name) for name in ("address", "sent", "log")]
        address, self._sent, self._log = files
        address.write_bytes(msgspec.json.encode(robot))
        with address.open() as asked, self._sent.open("wb") as sent, self._log.open("wb") as log:
            command = [sys.executable, "-P", "-m", pilot or _PROGRAM]
            super().__init__(command, stdin=asked, stdout=sent, stderr=log)

    def __exit__(self, *_: object) -> None:
        """Kill the driving process, and remove its files."""
        self.kill()
        self.wait()
        self._folder.cleanup()

    @property
    def sent(self) -> list[int]:
        """Time of each sent command, ns."""
        return [int(line) for line in self._sent.read_bytes().split(b"\n")[:-1]]

    def await_commands(self, count: int) -> None:
        """Wait until it has sent `count` commands."""
        until_s = time.monotonic() + _STARTED_S
        while len(self.sent) < count:
            if self.poll() is not None or time.monotonic() > until_s:
                log = self._log.read_text(errors="replace").strip()
                raise RobotError(f"The driver did not drive: {log}")
            time.sleep(0.002)


def asked_robot() -> KnownRobot:
    """Read the robot to drive from standard input."""
    return msgspec.json.decode(sys.stdin.buffer.read(), type=KnownRobot)


def print_time() -> None:
    """Print the time before a command is sent, so that no sent command can be missing."""
    sys.stdout.write(f"{time.monotonic_ns()}\n")
    sys.stdout.flush()


def main() -> None:
    """Drive at full throttle until the link or this process ends."""
    with RobotClient.connect(asked_robot()) as client:
        actions = Layout.from_json(client.welcome.action_layout)
        values = [float(name == "throttle") for name in actions.names]
        client.take()
        client.arm()
        client.acknowledge()
        seq = 0
        while True:
            seq = client.observation(seq).message.seq
            print_time()
            client.command(values, answers=seq)


if __name__ == "__main__":
    with translate_errors(LinkError, to=lambda error: SystemExit(str(error))):
        main()
