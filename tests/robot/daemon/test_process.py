"""The daemon in a separate process, as the supervisor starts it."""

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

import msgspec
import pytest

from shapechanger.contract.plan import ActionPlan, GuardPlan
from shapechanger.robot.daemon.process import LIFELINE, send_lifeline
from shapechanger.robot.guard.channel import encode
from shapechanger.robot.guard.running import ServePlan, plan_fd
from tests.robot.daemon.plans import car_plan, guard_state

pytestmark = pytest.mark.realtime


@dataclass
class Started:
    """A daemon process, and the other ends of its sockets."""

    process: subprocess.Popen[bytes]
    guard: socket.socket
    heart: socket.socket
    ready: Path
    life: int
    port: int = 0

    def ended(self) -> tuple[int, str]:
        assert self.process.stderr is not None
        with self.process.stderr as stderr:
            return self.process.wait(20.0), stderr.read().decode()


@pytest.fixture
def begun(tmp_path: Path) -> Iterator[Started]:
    file = tmp_path / "ready.json"
    daemon = msgspec.to_builtins(car_plan(camera=None, discovery=True, ready_file=str(file)))
    guard_plan = GuardPlan("car", (ActionPlan("steering"), ActionPlan("throttle")), ())
    plan = plan_fd(ServePlan(guard_plan, daemon))
    guard, guard_end = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    heart, heart_end = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ends = {"plan": plan, "guard": guard_end.fileno(), "heartbeat": heart_end.fileno()}
    arguments = [part for name, fd in ends.items() for part in (f"--{name}-fd", str(fd))]
    process = subprocess.Popen(
        [sys.executable, "-m", "shapechanger.robot.daemon.process", *arguments],
        pass_fds=tuple(ends.values()),
        stdin=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    )
    os.close(plan)
    guard_end.close()
    heart_end.close()
    heart.settimeout(20.0)
    log, (life,), _, _ = socket.recv_fds(guard, 16, 2)
    assert log == LIFELINE
    yield Started(process, guard, heart, file, life)
    for end in (guard, heart):
        end.close()
    os.close(life)
    process.kill()
    process.wait()
    if process.stderr is not None:
        process.stderr.close()


@pytest.fixture
def started(begun: Started) -> Started:
    begun.guard.send(encode(guard_state()))
    while not begun.ready.exists():
        assert begun.heart.recv(16)  # The daemon lives.
    begun.port = json.loads(begun.ready.read_text())["port"]
    return begun


def test_a_daemon_serves_sends_heartbeats_and_ends_on_a_signal(started: Started) -> None:
    """The daemon keeps serving after its log was closed."""
    assert started.heart.recv(16) == b"."
    assert started.process.stderr is not None
    started.process.stderr.close()
    for _ in range(20):
        with socket.create_connection(("127.0.0.1", started.port), 20.0) as client:
            client.sendall(b"GET /link HTTP/1.1\r\nHost: x\r\n\r\n")
            assert client.recv(4096).startswith(b"HTTP/1.1 400")
    started.process.send_signal(signal.SIGTERM)
    assert started.guard.recv(16) == b""
    assert started.process.wait(20.0) == 0


def test_the_lifeline_ends_when_the_daemon_is_killed(started: Started) -> None:
    """The thread of the lifeline must have no other file open."""
    tasks = Path(f"/proc/{started.process.pid}/task")
    assert 1 in {len(list((task / "fd").iterdir())) for task in tasks.iterdir()}
    poll = select.poll()
    poll.register(started.life, select.POLLIN)
    assert poll.poll(50) == []
    started.process.kill()
    assert poll.poll(20_000) == [(started.life, select.POLLHUP)]


def test_sending_the_lifeline_to_a_closed_socket_leaves_no_file_open() -> None:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.close()
    before = set(os.listdir("/proc/self/fd"))
    with theirs:
        send_lifeline(theirs.fileno())
        assert set(os.listdir("/proc/self/fd")) == before


def test_no_client_connects_before_the_first_state(begun: Started) -> None:
    assert begun.heart.recv(16) == b"."  # The daemon is running.
    begun.guard.close()
    status, log = begun.ended()
    assert (status, begun.ready.exists()) == (1, False)
    assert "listens" not in log
    assert "The guard has ended." in log


@pytest.mark.parametrize("lost", ["guard", "supervisor"])
def test_the_daemon_exits_when_another_process_is_lost(started: Started, lost: str) -> None:
    (started.guard if lost == "guard" else started.heart).close()
    status, log = started.ended()
    assert status == 1
    assert f"The {lost} has ended." in log
    assert "listens at 127.0.0.1" in log
    assert "is not announced: only this machine reaches 127.0.0.1" in log
