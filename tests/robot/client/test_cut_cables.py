"""Broken connections are detected in time, reported, and not hidden by stale data."""

import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.errors import LinkError, StaleObservation
from shapechanger.robot.client.client import RobotClient
from shapechanger.robot.link import messages as m
from tests.robot.client.robot import Robot, eventually

pytestmark = pytest.mark.realtime

Run = Callable[..., Robot]
Connect = Callable[..., RobotClient]

TIMEOUT_S = 0.3


def test_a_silent_connection_is_detected_in_time(run: Run, connect: Connect) -> None:
    robot = run()
    client = connect(robot, pace="lockstep", timeout_s=TIMEOUT_S)
    client.take()
    client.arm()
    seen = client.ask()
    robot.silent = True
    client.command((0.0, 1.0), answers=seen.message.seq)
    with pytest.raises(LinkError, match="no message for"):
        client.observation(seen.message.seq, timeout_s=60.0)
    assert not client.alive


def test_an_idle_link_stays_up(run: Run, connect: Connect) -> None:
    robot = run()
    client = connect(robot, timeout_s=TIMEOUT_S)
    eventually(lambda: len(robot.received(m.Ping)) > 3)
    assert client.alive


def test_a_closed_connection_is_detected_at_once(credentials: Path) -> None:
    robot = Robot()
    with robot.running(credentials):
        client = RobotClient.connect(robot.known, timeout_s=30.0)
        with ThreadPoolExecutor(1) as threads:
            waiting = threads.submit(client.observation, timeout_s=60.0)
            robot.cut()
            with pytest.raises(LinkError, match="lost"):
                waiting.result(10.0)
    with pytest.raises(LinkError, match="lost"):
        client.take()
    client.close()


def test_a_slow_robot_is_stale_and_not_lost(run: Run, connect: Connect) -> None:
    client = connect(run(delay_s=0.2))
    client.acknowledge()
    with pytest.raises(StaleObservation):
        client.observation(timeout_s=0.01)
    assert client.observation(timeout_s=10.0).message.seq == 1


@pytest.mark.timeout(30)  # The connection's timeout is 60 s.
def test_closing_a_dead_connection_does_not_wait_for_it(run: Run, connect: Connect) -> None:
    robot = run()
    client = connect(robot, timeout_s=60.0)
    robot.silent = True
    client.close()
    with pytest.raises(LinkError, match="The connection was closed: make a new one"):
        client.take()


@given(garbage=st.binary(max_size=100))
def test_an_invalid_message_ends_the_link(credentials: Path, garbage: bytes) -> None:
    robot = Robot(garbage=garbage)
    with robot.running(credentials), RobotClient.connect(robot.known) as client:
        with pytest.raises(LinkError, match="Not a valid message"):
            client.ask()
        assert not client.alive


def test_a_fatal_refusal_ends_the_link_with_its_reason(run: Run, connect: Connect) -> None:
    robot = run()
    client = connect(robot)
    robot.send(m.Refused(reason="Too many messages.", fatal=True))
    eventually(lambda: not client.alive)
    with pytest.raises(LinkError, match="Too many messages"):
        client.ask()


def test_a_blocked_connection_delivers_only_the_newest_command(run: Run, connect: Connect) -> None:
    robot = run()
    client = connect(robot)
    client.take()
    stuck = threading.Event()
    loop = client._loop
    assert loop is not None
    loop.call_soon_threadsafe(lambda: stuck.wait(10.0))
    for i in range(1, 6):
        client.command((0.0, i / 10), answers=0)
    stuck.set()
    eventually(lambda: bool(robot.received(m.Command)))
    client.ping()
    assert [command.values for command in robot.received(m.Command)] == [(0.0, 0.5)]
