"""The scene of an attack: a served twin, armed and at rest, and helpers to detect movements."""

import contextlib
from dataclasses import dataclass, field

from shapechanger.robot.twin.ledger import read_ledger
from shapechanger.robot.twin.robot import RunningRobot
from tests.robot.client.attacks.stranger import Stranger, key_bytes

FULL = (1.0, 1.0)
"""Full steering and throttle, which attackers command."""

CAP = 0.6
"""Largest duty of the motor that the profile allows."""

WRONG = b"\x5a" * 16
"""A key that the robot does not have."""


@dataclass
class Scene:
    """A robot under attack, armed and at rest, and the person who has control of it."""

    robot: RunningRobot
    port: int
    key: bytes
    operator: Stranger
    stack: contextlib.ExitStack = field(default_factory=contextlib.ExitStack)

    def stranger(self, **how: object) -> Stranger:
        return self.stack.enter_context(Stranger(self.port, **how))

    def knock(self, key: bytes = WRONG, role: str = "program", **fields: object) -> str:
        stranger = self.stranger()
        stranger.hello(key, role, **fields)
        return stranger.refusal()

    def inside(self, role: str = "program", name: str = "thief") -> Stranger:
        stranger = self.stranger()
        stranger.enter(self.key, role, name=name)
        return stranger


def movements(robot: RunningRobot) -> int:
    ledger = read_ledger(robot.ledger_path)
    return sum(line.kind == "pin" and bool(line.duty) for line in ledger)


def settle(robot: RunningRobot, key: bytes, wait_ns: int = 50_000_000) -> None:
    """Wait until the guard reports a state `wait_ns` later than now to an honest client."""
    with Stranger(robot.port) as honest:
        honest.enter(key, "person", name="honest")
        now_ns = honest.now_ns()
        while honest.observe()["state_ns"] < now_ns + wait_ns:
            pass


def key_of(robot: RunningRobot) -> bytes:
    return key_bytes((robot.folder / "credentials" / "key").read_text())
