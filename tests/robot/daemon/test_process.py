"""Daemon in its own process, as the supervisor starts it."""

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


def test_it_serves_sends_heartbeats_and_ends_on_a_signal(started: Started) -> None:
    """With exit status 0; the guard sees the end of the socket."""
    assert started.heart.recv(16) == b"."
    with socket.create_connection(("127.0.0.1", started.port), 20.0):
        pass
    started.process.send_signal(signal.SIGTERM)
    assert started.guard.recv(16) == b""
    status, said = started.ended()
    assert status == 0
    assert "listens at 127.0.0.1" in said
    assert "is not announced: only this machine reaches 127.0.0.1" in said


def test_the_lifeline_ends_when_it_is_killed(started: Started) -> None:
    """Not before."""
    poll = select.poll()
    poll.register(started.life, select.POLLIN)
    assert poll.poll(50) == []
    started.process.kill()
    assert poll.poll(20_000) == [(started.life, select.POLLHUP)]


def test_the_lifeline_thread_holds_no_other_file(started: Started) -> None:
    """A connection that the daemon closes is closed."""
    with socket.create_connection(("127.0.0.1", started.port), 20.0) as client:
        client.sendall(b"this is no request\r\n\r\n")
        while client.recv(4096):  # Until its end.
            pass
    tasks = Path(f"/proc/{started.process.pid}/task")
    held = {task.name: len(list((task / "fd").iterdir())) for task in tasks.iterdir()}
    assert 1 in held.values()


def test_a_missing_guard_is_no_crash() -> None:
    """The reader of the socket reports it."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.close()
    with theirs:
        assert send_lifeline(theirs.fileno())


def test_no_client_connects_before_the_first_state(begun: Started) -> None:
    """The state of the outputs would be unknown."""
    assert begun.heart.recv(16) == b"."  # It runs.
    begun.guard.close()
    status, said = begun.ended()
    assert (status, begun.ready.readline()) == (1, b"")
    assert "listens" not in said
    assert "The guard is gone." in said


def test_it_ends_with_the_guard(started: Started) -> None:
    """With an error message; the supervisor restarts both."""
    started.guard.close()
    status, said = started.ended()
    assert status == 1
    assert "The guard is gone." in said


def test_it_ends_with_the_supervisor(started: Started) -> None:
    """No process could stop the guard otherwise."""
    started.heart.close()
    status, said = started.ended()
    assert status == 1
    assert "The supervisor is gone." in said


def test_a_blocked_log_does_not_end_it(started: Started) -> None:
    """As with a full disk behind stderr: it goes on serving."""
    assert started.process.stderr is not None
    started.process.stderr.close()
    for _ in range(20):
        with socket.create_connection(("127.0.0.1", started.port), 20.0) as client:
            request = b"GET /link HTTP/1.1\r\nHost: x\r\n\r\n"
            client.sendall(request)
            assert client.recv(4096).startswith(b"HTTP/1.1 400")
    started.process.send_signal(signal.SIGTERM)
    assert started.process.wait(20.0) == 0
