"""Program that drives at full throttle in a separate process, by itself or as a policy.

It is started by path, reads the robot's address from standard input, and prints the time of each
sent command on a line: monotonic, ns. A policy fails at a signal, as `FAILURES` has it.
"""

from __future__ import annotations

import math
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any, Final, Self

import msgspec

from shapechanger.errors import LinkError, RobotError
from shapechanger.layout import Layout
from shapechanger.remote.client import RobotClient
from shapechanger.remote.known_robots import KnownRobot

_STARTED_S: Final = 30.0
# Longer than the age at which a robot refuses answers to an observation.
_LATE_S: Final = 0.5

FAILURES: Final = {
    "hangs": signal.SIGUSR1,
    "is late": signal.SIGUSR2,
    "gives NaN": signal.SIGALRM,
}
"""Signal at which a policy fails, by how it fails."""


class Driver:
    """The driving process.

    Args:
        robot: The robot.
        within: Command prefix, such as one that enters a network namespace.
        by_policy: Whether a policy drives, as on board; a person arms the robot for it.
    """

    def __init__(
        self, robot: KnownRobot, within: Sequence[str] = (), *, by_policy: bool = False
    ) -> None:
        self.process = subprocess.Popen(
            # By path, so that the command line is not imported.
            [*within, sys.executable, "-P", __file__, *(["policy"] if by_policy else [])],
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
    if sys.argv[1:] == ["policy"]:
        _drive_by_policy(robot)
        return
    with RobotClient.connect(robot) as client:
        values = [float(name == "throttle") for name in _names(client)]
        client.take()
        client.arm()
        client.acknowledge()
        seq = 0
        while True:
            seq = client.observation(seq).message.seq
            # Printed before it is sent, so that a kill in between cannot hide a command.
            _print_time()
            client.command(values, answers=seq)


def _print_time() -> None:
    sys.stdout.write(f"{time.monotonic_ns()}\n")
    sys.stdout.flush()


def _drive_by_policy(robot: KnownRobot) -> None:
    """Drive as the process on board does, with a policy that fails at a signal."""
    import numpy as np

    from shapechanger.demos.cloning.card import CloneCard
    from shapechanger.demos.cloning.pictures import Framing
    from shapechanger.vehicles.remote.pilot import PolicyDriver

    with RobotClient.connect(robot, frames=False) as client:
        actions = Layout.from_json(client.welcome.action_layout)
        state = Layout.from_json(client.welcome.state_layout)
    throttle = np.array([float(name == "throttle") for name in actions.names], np.float32)
    failing = ""

    class FullThrottle:
        """A policy that sees nothing and knows one command."""

        card = CloneCard(
            framing=Framing(),
            channels=(1,),
            features=1,
            eyes="none",
            nerves=(1,),
            action_layout=actions,
            state_layout=state,
        )

        def predict(self, picture: object, state: object = None) -> object:
            del picture, state
            while failing == "hangs":
                time.sleep(_LATE_S)
            if failing == "is late":
                time.sleep(_LATE_S)
            if failing == "gives NaN":
                return math.nan * throttle
            _print_time()
            return throttle

    def fail(number: int, _: object) -> None:
        nonlocal failing
        failing = next(how for how, one in FAILURES.items() if one == number)

    for number in FAILURES.values():
        signal.signal(number, fail)
    policy: Any = FullThrottle()
    PolicyDriver(policy, "policy", robot).run()


def _names(client: RobotClient) -> tuple[str, ...]:
    return Layout.from_json(client.welcome.action_layout).names


if __name__ == "__main__":
    try:
        main()
    except LinkError as error:
        sys.exit(str(error))
