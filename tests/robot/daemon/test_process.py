"""The daemon as a process of its own, as the supervisor starts it."""

from __future__ import annotations

import json
import os
import select
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import pytest

from shapechanger.robot.daemon.guard_link import LIFELINE, send_lifeline
from shapechanger.robot.guard.messages import encode
from shapechanger.robot.guard.plan import ActionPlan, GuardPlan
from shapechanger.robot.guard.serve_plan import ServePlan, plan_fd
from tests.robot.daemon.plans import car_plan, guard_state

pytestmark = pytest.mark.realtime


@dataclass
class Started:
    """A daemon's process, and the other ends of its sockets."""

    process: subprocess.Popen[bytes]
    guard: socket.socket
    heart: socket.socket
    ready: BinaryIO
    life: int
    port: int = 0

    def ended(self) -> tuple[int, str]:
        """Its exit status and what it said."""
        assert self.process.stderr is not None
        with self.process.stderr as stderr:
            return self.process.wait(20.0), stderr.read().decode()


@pytest.fixture
def begun() -> Iterator[Started]:
    """A daemon that the guard has said nothing to."""
    daemon = car_plan(camera=None, discovery=True).to_dict()
    guard_plan = GuardPlan("car", (ActionPlan("steering"), ActionPlan("throttle")), ())
    plan = plan_fd(ServePlan(guard_plan, daemon))
    guard, guard_end = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    heart, heart_end = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ready, ready_end = os.pipe()
    ends = {"plan": plan, "guard": guard_end.fileno(), "heartbeat": heart_end.fileno()}
    ends["ready"] = ready_end
    arguments = [part for name, fd in ends.items() for part in (f"--{name}-fd", str(fd))]
    process = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "shapechanger.robot.daemon",
            *arguments,
            "--ready-fd",
            str(ready_end),
        ],
        pass_fds=tuple(ends.values()),
        stdin=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    )
    for fd in (plan, ready_end):
        os.close(fd)
    guard_end.close()
    heart_end.close()
    heart.settimeout(20.0)
    said, (life,), _, _ = socket.recv_fds(guard, 16, 2)
    assert said == LIFELINE
    with os.fdopen(ready, "rb") as told:
        yield Started(process, guard, heart, told, life)
    for end in (guard, heart):
        end.close()
    os.close(life)
    process.kill()
    process.wait()
    if process.stderr is not None:
        process.stderr.close()


@pytest.fixture
def started(begun: Started) -> Started:
    """A daemon that serves."""
    begun.guard.send(encode(guard_state()))
    begun.port = json.loads(begun.ready.readline())["port"]
    return begun


def test_it_serves_shows_that_it_lives_and_ends_when_asked(started: Started) -> None:
    """Exit status 0, and the guard sees the end of the socket."""
    assert started.heart.recv(16) == b"."
    with socket.create_connection(("127.0.0.1", started.port), 20.0):
        pass
    started.process.send_signal(signal.SIGTERM)
    assert started.guard.recv(16) == b""
    status, said = started.ended()
    assert status == 0
    assert "listens at 127.0.0.1" in said
    assert "is not announced: only this machine reaches 127.0.0.1" in said


def test_its_life_is_over_when_it_is_killed(started: Started) -> None:
    """It says nothing before, and ends by itself then."""
    poll = select.poll()
    poll.register(started.life, select.POLLIN)
    assert poll.poll(50) == []
    started.process.kill()
    assert poll.poll(20_000) == [(started.life, select.POLLHUP)]


def test_whoever_holds_its_life_holds_nothing_else(started: Started) -> None:
    """A connection that the daemon closes is closed, though a thread has a copy of old files."""
    with socket.create_connection(("127.0.0.1", started.port), 20.0) as client:
        client.sendall(b"this is no request\r\n\r\n")
        while client.recv(4096):  # Until its end.
            pass
    tasks = Path(f"/proc/{started.process.pid}/task")
    held = {task.name: len(list((task / "fd").iterdir())) for task in tasks.iterdir()}
    assert 1 in held.values()


def test_a_guard_that_is_gone_before_is_no_crash() -> None:
    """Whoever reads its socket says so in words."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.close()
    with theirs:
        assert send_lifeline(theirs.fileno())


def test_nobody_is_let_in_before_the_guard_has_spoken(begun: Started) -> None:
    """They would see a robot of which nothing is known, not even what its outputs do."""
    assert begun.heart.recv(16) == b"."  # It runs.
    begun.guard.close()
    status, said = begun.ended()
    assert (status, begun.ready.readline()) == (1, b"")
    assert "listens" not in said
    assert "The guard is gone." in said


def test_it_ends_with_the_guard(started: Started) -> None:
    """In words, for the supervisor to start both again."""
    started.guard.close()
    status, said = started.ended()
    assert status == 1
    assert "The guard is gone." in said


def test_it_ends_with_the_supervisor(started: Started) -> None:
    """Nobody would be there to stop it."""
    started.heart.close()
    status, said = started.ended()
    assert status == 1
    assert "The supervisor is gone." in said


def test_a_log_that_nobody_can_write_does_not_end_it(started: Started) -> None:
    """As with a full disk behind stderr: it goes on serving, and ends when asked."""
    assert started.process.stderr is not None
    started.process.stderr.close()
    for _ in range(20):
        with socket.create_connection(("127.0.0.1", started.port), 20.0) as client:
            request = b"GET /link HTTP/1.1\r\nHost: x\r\n\r\n"
            client.sendall(request)
            assert client.recv(4096).startswith(b"HTTP/1.1 400")
    started.process.send_signal(signal.SIGTERM)
    assert started.process.wait(20.0) == 0
