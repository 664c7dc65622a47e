"""The client against a robot on a real socket: what goes well, and what is refused."""

from __future__ import annotations

import multiprocessing
import threading
import traceback
from collections.abc import Callable
from dataclasses import replace

import pytest

from shapechanger.errors import LinkError, RobotRefused
from shapechanger.link import messages as m
from shapechanger.link.authentication import new_key
from shapechanger.remote.client import RobotClient
from tests.remote.robot import Robot, eventually

pytestmark = pytest.mark.realtime

Run = Callable[..., Robot]
Connect = Callable[..., RobotClient]


def test_a_program_takes_arms_commands_and_sees(run: Run, connect: Connect) -> None:
    """The whole conversation, in the order in which it is had."""
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
    (command,) = robot.told(m.Command)
    assert (command.answers, command.ttl_ms, command.scale) == (before.message.seq, 250, 1.0)


def test_arming_answers_what_is_true_now_and_ends_what_was_seen(run: Run, connect: Connect) -> None:
    """An emergency stop of a moment ago is not ended by who has not seen it."""
    robot = run()
    client = connect(robot, role="person")
    client.take()
    seen = client.ask().message
    robot.emergency = True
    client.arm()
    (arm,) = robot.told(m.Arm)
    assert arm.answers == seen.seq + 1
    assert arm.emergency == seen.emergencies == 0


def test_commands_are_numbered_whoever_sends_them(run: Run, connect: Connect) -> None:
    """Two threads never send the same number."""
    client = connect(run(), pace="lockstep")
    numbers: list[int] = []
    threads = [
        threading.Thread(
            target=lambda: numbers.extend(client.command((0.0, 0.0), answers=0) for _ in range(50))
        )
        for _ in range(2)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(numbers) == list(range(1, 101))


def test_a_ping_takes_some_time(run: Run, connect: Connect) -> None:
    """And brings the robot's."""
    took_s, now_ns = connect(run()).ping()
    assert 0.0 < took_s < 5.0
    assert now_ns > 0


def test_without_a_fingerprint_one_is_shown_and_nothing_is_trusted(run: Run) -> None:
    """A person compares it; the message has the command that remembers it."""
    robot = run()
    with pytest.raises(LinkError) as refused:
        RobotClient.connect(robot.address, key=robot.key)
    assert robot.fingerprint in str(refused.value)
    assert f"robot remember NAME {robot.address} --fingerprint {robot.fingerprint}" in str(
        refused.value
    )
    assert robot.connections == 0


def test_another_certificate_is_refused_and_both_are_shown(run: Run) -> None:
    """Before the key has been used for anything."""
    robot = run()
    expected = "ab" * 32
    with pytest.raises(RobotRefused) as refused:
        RobotClient.connect(replace(robot.known, fingerprint=expected))
    assert robot.fingerprint in str(refused.value)
    assert expected in str(refused.value)
    assert robot.heard == []


def test_a_wrong_key_is_refused(run: Run) -> None:
    """In the robot's words."""
    with pytest.raises(RobotRefused, match="Wrong key"):
        RobotClient.connect(replace(run().known, key=new_key()))


@pytest.mark.parametrize(("version", "older"), [(0, "robot"), (2, "workstation")])
def test_another_version_says_what_to_update(run: Run, version: int, older: str) -> None:
    """The side that is behind."""
    with pytest.raises(LinkError, match=f"on the {older}"):
        RobotClient.connect(run(version=version).known)


def test_nobody_there_is_said_at_once(run: Run, credentials: object) -> None:
    """With what to look at."""
    robot = Robot()
    with robot.running(credentials):  # type: ignore[arg-type]
        known = robot.known
    with pytest.raises(LinkError, match="shapechanger robot serve"):
        RobotClient.connect(known)


def test_a_program_that_finds_nobody_sees_one_error(run: Run, credentials: object) -> None:
    """In our words alone: no chain of the socket's errors, no calls of another thread."""
    robot = Robot()
    with robot.running(credentials):  # type: ignore[arg-type]
        known = robot.known
    with pytest.raises(LinkError, match="Connect call failed") as refused:
        RobotClient.connect(known)
    shown = "".join(traceback.format_exception(refused.value))
    assert shown.count("Traceback") == 1
    assert "aiohttp" not in shown
    assert "asyncio" not in shown


def test_a_question_that_fails_is_one_error(run: Run, connect: Connect) -> None:
    """Also where the link is lost between question and answer."""
    robot = run(delay_s=60.0)
    client = connect(robot, timeout_s=30.0)
    threading.Thread(
        target=lambda: (eventually(lambda: bool(robot.told(m.Take))), robot.cut())
    ).start()
    with pytest.raises(LinkError, match="lost") as refused:
        client.take()
    assert "".join(traceback.format_exception(refused.value)).count("Traceback") == 1


def test_a_client_that_is_abandoned_gives_the_robot_back(run: Run, connect: Connect) -> None:
    """Without waiting for anything, and twice does nothing more."""
    robot = run()
    client = connect(robot)
    client.take()
    client.abandon()
    eventually(lambda: bool(robot.told(m.Release)) and not client.alive)
    client.abandon()
    assert len(robot.told(m.Release)) == 1


def test_without_tls_only_what_was_typed_connects(run: Run) -> None:
    """A plain connection to a port that speaks TLS fails in words."""
    with pytest.raises(LinkError):
        RobotClient.connect(run().address, fingerprint="insecure", timeout_s=1.0)


def test_a_robot_that_somebody_else_drives_is_not_taken(run: Run, connect: Connect) -> None:
    """In the robot's words."""
    client = connect(run(held_by="Grace"))
    with pytest.raises(RobotRefused, match="Grace has control"):
        client.take()


def test_arming_is_refused_in_words(run: Run, connect: Connect) -> None:
    """Only a person arms, by default."""
    client = connect(run(arming="person"))
    client.take()
    with pytest.raises(RobotRefused, match="Only a person"):
        client.arm()
    person = connect(run(arming="person"), role="person")
    person.take()
    person.arm()


def test_a_refused_command_says_why(run: Run, connect: Connect) -> None:
    """Of this command, not of the one before."""
    robot = run(refusal="It is too old.")
    client = connect(robot, pace="lockstep")
    client.take()
    before = client.ask()
    seq = client.command((0.0, 1.0), answers=before.message.seq)
    client.observation(before.message.seq)
    assert client.refusal(seq) == "It is too old."
    assert client.refusal(seq + 1) == ""


def test_what_happens_is_told_once(run: Run, connect: Connect) -> None:
    """Events wait until somebody asks, and are bounded."""
    robot = run()
    client = connect(robot)
    for i in range(300):
        robot.say(m.Event(name="bump", text=f"Bump {i}.", at_ns=i))
    client.ping()
    assert [event.text for event in client.events()] == [f"Bump {i}." for i in range(44, 300)]
    assert client.events() == []


def test_an_emergency_stop_leaves_before_the_goodbye(run: Run, connect: Connect) -> None:
    """Whoever stops and closes has stopped."""
    robot = run()
    client = connect(robot)
    client.emergency_stop("a dog")
    client.close()
    eventually(lambda: robot.told(m.EmergencyStop) == [m.EmergencyStop(reason="a dog")])


def test_a_closed_client_says_so(run: Run, connect: Connect) -> None:
    """To whatever is asked of it."""
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
def test_a_copy_made_by_fork_leaves_the_link_alone(run: Run, connect: Connect) -> None:
    """A worker process must connect for itself; the parent's link stands."""
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


@pytest.mark.parametrize("timeout_s", [0.0, -1.0, float("nan")])
def test_a_timeout_that_is_none_is_refused(timeout_s: float) -> None:
    """Before anything is connected."""
    with pytest.raises(LinkError, match="above 0"):
        RobotClient.connect("192.0.2.1", timeout_s=timeout_s)
