"""Attackers that occupy all connections, and thieves of the key."""

import base64
import itertools
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from shapechanger.robot.twin.ledger import read_ledger
from shapechanger.robot.twin.robot import RunningRobot
from tests.robot.client.attacks.scene import CAP, WRONG, Scene, key_of, settle
from tests.robot.client.attacks.stranger import Stranger, header

pytestmark = [pytest.mark.system, pytest.mark.realtime]

DRIVE_PINS = (22, 27)
ELSEWHERE = [f"127.0.0.{number}" for number in range(2, 8)]  # Addresses of attackers.


# Many connections at once; before a hello, 16 per address and 48 in all are permitted.


def knocks(scene: Scene, source: str) -> Stranger:
    stranger = scene.stranger(source=source)
    stranger.hello(os.urandom(16), "person")
    return stranger


def says_nothing(scene: Scene, source: str) -> Stranger:
    return scene.stranger(source=source, version=None)


def half_a_request(scene: Scene, source: str) -> Stranger:
    stranger = scene.stranger(source=source)
    stranger.write(b"GET /link HTTP/1.1\r\nHost: x\r\n")
    return stranger


def half_a_hello(scene: Scene, source: str) -> Stranger:
    stranger = scene.stranger(source=source)
    stranger.challenge()
    stranger.write(header(100) + b"\x81\xa4kind")
    return stranger


def thief_without_a_word(scene: Scene, source: str) -> Stranger:
    """Connect as a person with the key, without reading any message afterwards."""
    stranger = scene.stranger(source=source)
    stranger.hello(scene.key, "person", name="thief")
    return stranger


HOLDS = (knocks, says_nothing, half_a_hello, thief_without_a_word)


@pytest.mark.parametrize("hold", HOLDS, ids=lambda hold: hold.__name__)
def test_a_person_can_stop_a_robot_whose_connections_are_occupied(
    scene: Scene, hold: Callable[[Scene, str], Stranger]
) -> None:
    count = 9 if "thief" in hold.__name__ else 54
    held = [hold(scene, source) for _ in range(count // 6 + 1) for source in ELSEWHERE]
    person = scene.stranger()
    person.enter(scene.key, "person", name="Ada")
    person.send("emergencystop", reason="a child")
    while not scene.operator.observe()["emergency"]:
        pass
    assert len(held) >= count
    assert not any(b"welcome" in stranger.unread for stranger in held if hold is knocks)


@pytest.mark.parametrize("hold", [half_a_request, half_a_hello])
def test_a_slow_connection_ends_however_many_bytes_it_sends(
    scene: Scene, hold: Callable[[Scene, str], Stranger]
) -> None:
    held = slow = [hold(scene, source) for source in ELSEWHERE]
    while slow:
        for stranger in slow:
            stranger.write(b"x")
        assert scene.operator.observe()["armed"]
        slow = [stranger for stranger in slow if stranger.is_open()]
    assert not any(b"welcome" in stranger.unread for stranger in held)


# Thieves of the key.


def test_a_thief_of_the_key_stays_within_the_limits_of_the_guard(robot: RunningRobot) -> None:
    key = key_of(robot)
    before = len(read_ledger(robot.ledger_path))
    with Stranger(robot.port) as thief:
        thief.control(key, "thief")
        for seq in itertools.count(1):
            thief.drive(seq, 1e6, 1e6, ttl_ms=60_000)
            if thief.expect("observation")["applied_seq"]:
                break
        settle(robot, key, 1_100_000_000)  # The deadline is 1 s.
        assert thief.observe()["armed"]
    ledger = read_ledger(robot.ledger_path)[before:]
    drive = [line.duty for line in ledger if line.kind == "pin" and line.pin in DRIVE_PINS]
    assert max(duty or 0.0 for duty in drive) == pytest.approx(CAP)
    assert drive[-1] == 0.0


def test_no_log_contains_a_key_or_a_proof(robot: RunningRobot) -> None:
    text = (robot.folder / "credentials" / "key").read_text().strip()
    private = (robot.folder / "credentials" / "certificate.key").read_text().splitlines()[1:-1]
    secrets = [key_of(robot)]
    for held, role in ((secrets[0], "person"), (secrets[0], "program"), (WRONG, "person")):
        with Stranger(robot.port) as client:
            client.hello(held, role, name="Lin\nguard: Armed.\x1b[2J")
            client.receive()
            secrets.append(client.proof)
    written = b""
    for path in ("/", "/console/robot.json"):
        with Stranger(robot.port) as client:
            page = client.request(f"GET {path} HTTP/1.1", Connection="close") + client.rest()
            written += page.encode()
    processes = [robot.supervisor.pid, robot.pid_of("guard"), robot.pid_of("daemon")]
    places = [f"/proc/{pid}/{name}" for pid in processes for name in ("cmdline", "environ")]
    places += [p for p in robot.folder.rglob("*") if p.is_file() and p.parent.name != "credentials"]
    written += b"".join(Path(place).read_bytes() for place in places)
    forms = [*private, text, text.replace("-", ""), text.lower()]
    for secret in secrets:
        forms += [secret.hex(), repr(secret), base64.b64encode(secret).decode().rstrip("=")]
        assert secret not in written
    assert [form for form in forms if form.encode() in written] == []
    log = robot.log_text()
    assert "Lin guard: Armed. [2J, a person, connected" in log
    assert "Wrong key" in log
    assert b"shapechanger" in written
