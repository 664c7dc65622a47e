"""Send mutated messages to a robot: no crash, no accepted command, constant memory.

`python -m benchmarks.fuzz_link --count 1000000` mutates messages of many kinds (flipped bits, cuts,
splices, wrong lengths, deep nesting, huge numbers) and passes them to a session of the daemon, as
its WebSocket would. Another client controls the robot, so the robot accepts commands. The fuzzing
client may only send an emergency stop. `tests/robot/daemon/test_fuzz.py` sends a few thousand.
"""

from __future__ import annotations

import argparse
import collections
import random
import time
from collections.abc import Callable
from pathlib import Path

from shapechanger.errors import LinkError
from shapechanger.layout import Feature, Layout
from shapechanger.robot.daemon.credentials import Authenticator
from shapechanger.robot.daemon.hub import SessionHub
from shapechanger.robot.daemon.plan import DaemonPlan
from shapechanger.robot.daemon.session import Session
from shapechanger.robot.guard.channel import Order
from shapechanger.robot.hardware import Clock
from shapechanger.robot.link.card import RobotCard
from shapechanger.robot.link.messages import (
    VERSION,
    Acknowledge,
    Arm,
    Browse,
    Command,
    Disarm,
    EmergencyStop,
    Fetch,
    Hello,
    Judge,
    Mark,
    Ping,
    Record,
    Release,
    Suggest,
    Take,
    Undo,
    encode,
)

ACTIONS = Layout((Feature("steering", "1", -1.0, 1.0), Feature("throttle", "1", -1.0, 1.0)))
PLAN = DaemonPlan(
    card=RobotCard(
        robot="fuzzed",
        body="car",
        action_layout=ACTIONS.to_json(),
        state_layout=ACTIONS.to_json(),
        image_size=None,
        control_hz=20.0,
        deadline_ms=250,
        max_observation_age_ms=400,
        reward={},
        reset=(),
        arming="person",
        clock="real",
    )
)
KEY = bytes(range(16))

SEEDS = [
    encode(message)
    for message in (
        Hello(version=VERSION, proof=bytes(32), name="fuzzer"),
        Command(seq=1, answers=1, values=(0.25, 0.5)),
        Command(seq=2**40, answers=3, values=(1.0,) * 12, ttl_ms=100, scale=0.5),
        Acknowledge(seq=1),
        Take(),
        Release(),
        Arm(answers=1, emergency=1),
        Disarm(),
        EmergencyStop(reason="fuzz"),
        Ping(token=3),
        Suggest(seq=1, answers=1, values=(0.25, 0.5)),
        Record(on=True, name="corridor"),
        Mark(text="a corner"),
        Undo(seconds=5.0),
        Browse(before="20260101T000000Z-0001"),
        Fetch(episode="20260101T000000Z-0001", first=1, count=20),
        Judge(episode="20260101T000000Z-0001", first=1, last=20),
    )
]

# Headers of msgpack values longer than their data, and extreme values.
FRAGMENTS = [
    b"\xdd\xff\xff\xff\xff",
    b"\xdf\xff\xff\xff\xff",
    b"\xc6\xff\xff\xff\xff",
    b"\xdb\xff\xff\xff\xff",
    b"\xc9\xff\xff\xff\xff\x01",
    b"\xcf\xff\xff\xff\xff\xff\xff\xff\xff",
    b"\xd3\x80\x00\x00\x00\x00\x00\x00\x00",
    b"\xcb\x7f\xf0\x00\x00\x00\x00\x00\x00",
    b"\xcb\x7f\xf8\x00\x00\x00\x00\x00\x00",
    b"\xc1",
    b"\xc0",
]


class _Clock(Clock):
    """A clock that the fuzzer sets."""

    ns = 1_000_000_000

    def now_ns(self) -> int:
        return self.ns


def mutated(rng: random.Random) -> bytes:
    """Return a mutated valid message; a few remain valid."""
    data = bytearray(rng.choice(SEEDS))
    for _ in range(rng.choice((1, 1, 1, 2, 4, 8))):
        where = rng.randrange(len(data) + 1)
        match rng.randrange(7):
            case 0 if data:
                bit = rng.randrange(8 * len(data))
                data[bit // 8] ^= 1 << bit % 8
            case 1:
                del data[where:]
            case 2:
                other = rng.choice(SEEDS)
                data[where:] = other[rng.randrange(len(other)) :]
            case 3:
                data[where : where + rng.randrange(9)] = rng.choice(FRAGMENTS)
            case 4:
                data[where:where] = rng.choice((b"\x91", b"\x81\xa1x")) * rng.randrange(2_000)
            case 5:
                data[where : where + rng.randrange(4)] = rng.randbytes(rng.randrange(16))
            case _:
                del data[where : where + rng.randrange(1, 4)]
    return bytes(data)


def resident_kb() -> int:
    """Return the resident memory of this process, kB."""
    status = Path("/proc/self/status").read_text()
    return int(status.split("VmRSS:")[1].split()[0])


def _drained(session: Session) -> None:
    while session.client.take() is not None:
        pass


def fuzz(
    count: int, seed: int = 0, progress: Callable[[int], None] = lambda _: None
) -> collections.Counter[str]:
    """Send mutated messages to unauthenticated sessions and to sessions without the lease.

    Returns:
        Number of strangers that were refused, of messages that ended the connection, of decoded
        messages, and of orders of each kind that were given to the guard.

    Raises:
        AssertionError: If a command, halt or arming came through, a stranger was let in, or the
            owner lost control.
    """
    rng = random.Random(seed)
    counts: collections.Counter[str] = collections.Counter()
    orders: list[Order] = []
    clock = _Clock()
    hub = SessionHub(PLAN, clock, orders.append)
    owner = Session(0, hub, Authenticator())
    owner.introduce(encode(Hello(version=VERSION, proof=b"", role="person", name="owner")))
    owner.receive(encode(Take()))
    known: Session | None = None
    for number in range(1, count + 1):
        clock.ns += 1_000_000
        data = mutated(rng)
        if number % 4 == 0:  # An unauthenticated connection to a robot with a key.
            stranger = Session(number, hub, Authenticator(KEY))
            try:
                stranger.introduce(data)
            except LinkError:
                counts["strangers refused"] += 1
            else:
                raise AssertionError(f"A stranger was let in with {data!r}.")
            continue
        if known is None:
            known = Session(number, hub, Authenticator(), messages_per_s=1e9)
            known.introduce(encode(Hello(version=VERSION, proof=b"", name="known")))
            known.observe()
        try:
            known.receive(data)
        except LinkError:
            counts["connections ended"] += 1
            hub.leave(known.client)
            known = None
        else:
            counts["understood"] += 1
            _drained(known)
        _drained(owner)
        for order in orders:
            counts[f"order {order.kind}"] += 1
            if order.kind in ("command", "halt", "arm"):
                raise AssertionError(f"{order} came through, by {data!r}.")
        orders.clear()
        if number % 50_000 < 4:
            progress(number)
    if hub.holder is not owner.client:
        raise AssertionError("The owner lost control of the robot.")
    return counts


def main() -> None:
    """Fuzz and print the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    fuzz(5_000, asked.seed + 1)  # Warm up: load modules and caches.
    began, before_kb, most_kb = time.perf_counter(), resident_kb(), 0

    def watch(_: int) -> None:
        nonlocal most_kb
        most_kb = max(most_kb, resident_kb())

    counts = fuzz(asked.count, asked.seed, watch)
    took_s = time.perf_counter() - began
    for name, number in sorted(counts.items()):
        print(f"{name}: {number}")
    print(f"{asked.count} messages in {took_s:.0f} s ({asked.count / took_s:.0f}/s)")
    print(f"resident: {before_kb} kB before, {most_kb} kB at most, {resident_kb()} kB after")


if __name__ == "__main__":
    main()
