"""The client against a fake robot on a real socket."""

from __future__ import annotations

import multiprocessing
import traceback
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import pytest

from shapechanger.errors import LinkError, RobotRefused
from shapechanger.robot.client.client import RobotClient
from shapechanger.robot.link import messages as m
from shapechanger.robot.link.authentication import new_key
from tests.robot.client.robot import Robot, eventually

pytestmark = pytest.mark.realtime

Run = Callable[..., Robot]
Connect = Callable[..., RobotClient]


def test_a_program_takes_control_arms_and_commands(run: Run, connect: Connect) -> None:
    robot = run()
    client = connect(robot, pace="lockstep", name="ada")
    client.take()
    client.arm()
    before = client.ask()
    after = client.exchange((0.0, 0.5), before)
    assert client.welcome.robot == "tin"
    assert after.message.action_applied == (0.0, 0.5)
    assert after.message.seq > before.message.seq
    assert after.jpeg != before.jpeg
    client.close()
    client.close()
    (command,) = robot.received(m.Command)
    assert (command.answers, command.ttl_ms, command.scale) == (before.message.seq, 250, 1.0)


def test_arming_ends_only_an_emergency_stop_that_was_seen(run: Run, connect: Connect) -> None:
    robot = run()
    client = connect(robot, role="person")
    client.take()
    seen = client.ask().message
    robot.emergency = True
    client.arm()
    (arm,) = robot.received(m.Arm)
    assert arm.answers == seen.seq + 1
    assert arm.emergency == seen.emergencies == 0


def test_commands_of_two_threads_have_different_numbers(run: Run, connect: Connect) -> None:
    client = connect(run(), pace="lockstep")
    with ThreadPoolExecutor(2) as threads:
        numbers = threads.map(lambda _: client.command((0.0, 0.0), answers=0), range(100))
    assert sorted(numbers) == list(range(1, 101))


@pytest.mark.parametrize(
    ("version", "changes", "text"),
    [
        (m.VERSION, {"key": new_key()}, "Wrong key"),
        # A client without encryption, at a robot that encrypts.
        (m.VERSION, {"key": "", "fingerprint": "insecure"}, "No robot answers"),
        (0, {}, "on the robot"),
        (2, {}, "on the workstation"),
    ],
    ids=["key", "plain", "older", "newer"],
)
def test_a_robot_with_another_key_or_version_is_refused(
    run: Run, version: int, changes: dict[str, str], text: str
) -> None:
    robot = run(version=version)
    with pytest.raises((LinkError, RobotRefused), match=text):
        RobotClient.connect(replace(robot.known, **changes), timeout_s=1.0)
    assert robot.messages == []


@pytest.mark.parametrize("timeout_s", [0.0, float("nan")])
def test_an_invalid_timeout_is_an_error(timeout_s: float) -> None:
    with pytest.raises(LinkError, match="above 0"):
        RobotClient.connect("192.0.2.1", timeout_s=timeout_s)


def test_without_a_fingerprint_the_error_shows_one(run: Run) -> None:
    robot = run()
    with pytest.raises(LinkError) as refused:
        RobotClient.connect(robot.address, key=robot.key)
    remedy = f"robot remember NAME {robot.address} --fingerprint {robot.fingerprint}"
    assert remedy in str(refused.value)
    assert robot.connections == 0


def test_another_certificate_is_refused_and_both_are_shown(run: Run) -> None:
    robot = run()
    expected = "ab" * 32
    with pytest.raises(RobotRefused) as refused:
        RobotClient.connect(replace(robot.known, fingerprint=expected))
    assert robot.fingerprint in str(refused.value)
    assert expected in str(refused.value)
    assert robot.messages == []


def test_a_missing_robot_gives_one_error_without_a_chain(run: Run, credentials: object) -> None:
    robot = Robot()
    with robot.running(credentials):  # type: ignore[arg-type]
        known = robot.known
    text = "(?s)Connect call failed.*shapechanger robot serve"
    with pytest.raises(LinkError, match=text) as refused:
        RobotClient.connect(known)
    shown = "".join(traceback.format_exception(refused.value))
    assert shown.count("Traceback") == 1
    assert "aiohttp" not in shown
    assert "asyncio" not in shown


def test_a_refusal_to_arm_has_a_reason(run: Run, connect: Connect) -> None:
    client = connect(run(arming="person"))
    client.take()
    with pytest.raises(RobotRefused, match="Only a person"):
        client.arm()
    person = connect(run(arming="person"), role="person")
    person.take()
    person.arm()


def test_an_emergency_stop_is_sent_before_closing(run: Run, connect: Connect) -> None:
    robot = run()
    client = connect(robot)
    client.emergency_stop("a dog")
    client.close()
    eventually(lambda: robot.received(m.EmergencyStop) == [m.EmergencyStop(reason="a dog")])


def test_a_closed_client_raises_an_error(run: Run, connect: Connect) -> None:
    client = connect(run())
    client.close()
    assert not client.alive
    for ask in (client.take, client.ask, client.ping, client.release, client.observation):
        with pytest.raises(LinkError, match="make a new one"):
            ask()


def _in_child(client: RobotClient, answers: multiprocessing.Queue[str]) -> None:
    try:
        client.acknowledge()
    except LinkError as error:
        answers.put(str(error))
    client.close()


@pytest.mark.filterwarnings("ignore:.*multi-threaded, use of fork.*:DeprecationWarning")
def test_a_forked_client_does_not_touch_the_connection(run: Run, connect: Connect) -> None:
    client = connect(run(), pace="lockstep")
    context = multiprocessing.get_context("fork")
    answers = context.Queue()
    child = context.Process(target=_in_child, args=(client, answers))
    child.start()
    assert "another process" in answers.get(timeout=20.0)
    child.join(20.0)
    answers.close()
    answers.join_thread()
    assert child.exitcode == 0
    assert client.ask().message.seq > 0
