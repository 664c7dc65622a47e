"""Attacks on a served robot by a client that was written from docs/remote.md alone.

The robot is a twin in real time, with its real supervisor, guard and daemon. A person holds control
of it, armed and at rest, while each attack runs, so that any command that came through would move a
pin.
After the attack the twin's ledger must show no movement, and the robot must serve an honest client.
"""

from __future__ import annotations

import base64
import contextlib
import itertools
import math
import os
import ssl
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import msgspec.msgpack
import pytest

from shapechanger.twin.robot import RunningRobot, run_robot
from shapechanger.twin.signals import read_ledger
from tests.remote.stranger import (
    BINARY,
    PING,
    TEXT,
    Stranger,
    frame,
    header,
    key_bytes,
    proof,
)
from tests.robots import BLIND_CAR, IN_A_ROOM, changed, write_profile

pytestmark = [pytest.mark.system, pytest.mark.realtime]

FULL = (1.0, 1.0)  # What every attacker wants the outputs to do.
FULL_MIX, CAP = "mix = { throttle = 1.0 }", 0.6  # What the profile allows.
DRIVE_PINS = (22, 27)
WRONG = b"\x5a" * 16
ELSEWHERE = [f"127.0.0.{number}" for number in range(2, 8)]  # Addresses of attackers.


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningRobot]:
    """A car without sensors, for all attacks."""
    folder = tmp_path_factory.mktemp("attacked")
    profile = write_profile(folder, changed(FULL_MIX, f"mix = {{ throttle = {CAP} }}", BLIND_CAR))
    with run_robot(profile, folder=folder, arguments=IN_A_ROOM) as served:
        yield served


@dataclass
class Scene:
    """A robot under attack.

    Attributes:
        robot: Its processes.
        port: Its port.
        key: Its key.
        operator: The person in control, whose robot is armed and at rest.
        stack: Closes the connections.
    """

    robot: RunningRobot
    port: int
    key: bytes
    operator: Stranger
    stack: contextlib.ExitStack = field(default_factory=contextlib.ExitStack)

    def stranger(self, **how: object) -> Stranger:
        """Connect, without any request."""
        return self.stack.enter_context(Stranger(self.port, **how))

    def knock(self, key: bytes = WRONG, role: str = "program", **fields: object) -> str:
        """Say hello, and return why the robot refuses."""
        stranger = self.stranger()
        stranger.hello(key, role, **fields)
        return stranger.refusal()

    def inside(self, role: str = "program", name: str = "thief") -> Stranger:
        """Connect with the robot's key."""
        stranger = self.stranger()
        stranger.enter(self.key, role, name=name)
        return stranger


def movements(robot: RunningRobot) -> int:
    """Return how often a pin of the motors has left rest."""
    ledger = read_ledger(robot.ledger_path)
    return sum(line.kind == "pin" and bool(line.duty) for line in ledger)


def settle(robot: RunningRobot, key: bytes, wait_ns: int = 50_000_000) -> None:
    """Let an honest client see a state of the guard that is later than all that was sent.

    Args:
        robot: The robot.
        key: Its key.
        wait_ns: Time by which the state is later, ns.
    """
    with Stranger(robot.port) as honest:
        honest.enter(key, "person", name="honest")
        now_ns = honest.now_ns()
        while honest.observe()["state_ns"] < now_ns + wait_ns:
            pass


@pytest.fixture
def scene(robot: RunningRobot) -> Iterator[Scene]:
    """The robot, armed by a person who does not command. Nothing may move until the test ends."""
    key = key_bytes((robot.folder / "credentials" / "key").read_text())
    before, pids = movements(robot), [robot.pid_of("guard"), robot.pid_of("daemon")]
    with Stranger(robot.port) as operator:
        operator.enter(key, "person", name="Grace")
        while not operator.take()["mine"]:
            pass  # The client of the test before may still be leaving.
        operator.arm()
        made = Scene(robot, robot.port, key, operator)
        with made.stack:
            yield made
            settle(robot, key)
            assert movements(robot) == before
    assert [robot.pid_of("guard"), robot.pid_of("daemon")] == pids


Attack = Callable[[Scene], str]
ATTACKS: dict[str, tuple[Attack, str]] = {}


def refused(words: str) -> Callable[[Attack], Attack]:
    """Register an attack that must return a text with `words`."""

    def register(attack: Attack) -> Attack:
        ATTACKS[attack.__name__] = attack, words
        return attack

    return register


# Without the key.


@refused("Wrong key")
def no_proof(scene: Scene) -> str:
    """Leave the proof empty."""
    return scene.knock(proof=b"")


@refused("Wrong key")
def wrong_key(scene: Scene) -> str:
    """Prove another key."""
    return scene.knock()


@refused("Wrong key")
def truncated_proof(scene: Scene) -> str:
    """Send the first half of a right proof."""
    stranger = scene.stranger()
    known = proof(scene.key, stranger.challenge(), stranger.certificate, "program")
    stranger.send("hello", version=1, proof=known[:16], role="program")
    return stranger.refusal()


@refused("Not a valid message")
def long_proof(scene: Scene) -> str:
    """Send more bytes than a proof may have."""
    return scene.knock(proof=bytes(65))


@refused("Wrong key")
def role_swap(scene: Scene) -> str:
    """Change the role of an honest program's hello on the way."""
    stranger = scene.stranger()
    known = proof(scene.key, stranger.challenge(), stranger.certificate, "program")
    stranger.send("hello", version=1, proof=known, role="person")
    return stranger.refusal()


@refused("Not a valid message")
def unknown_role(scene: Scene) -> str:
    """Claim a role that does not exist."""
    return scene.knock(scene.key, "root")


@refused("Wrong key")
def replayed_hello(scene: Scene) -> str:
    """Repeat the recorded hello of an honest client on a new connection."""
    honest, stranger = scene.stranger(), scene.stranger()
    known = proof(scene.key, honest.challenge(), honest.certificate, "person")
    honest.send("hello", version=1, proof=known, role="person")
    honest.expect("welcome")
    stranger.challenge()
    stranger.send("hello", version=1, proof=known, role="person")
    return stranger.refusal()


@refused("Wrong key")
def man_in_the_middle(scene: Scene) -> str:
    """Pass on a proof that an honest client made for another certificate."""
    stranger = scene.stranger()
    known = proof(scene.key, stranger.challenge(), b"\x01" * 32, "person")
    stranger.send("hello", version=1, proof=known, role="person")
    return stranger.refusal()


@refused("Wrong key")
def proof_of_no_certificate(scene: Scene) -> str:
    """Pass on a proof that an honest client made without TLS."""
    stranger = scene.stranger()
    known = proof(scene.key, stranger.challenge(), b"", "person")
    stranger.send("hello", version=1, proof=known, role="person")
    return stranger.refusal()


@refused("must be a hello")
def command_before_hello(scene: Scene) -> str:
    """Command, without an introduction."""
    stranger = scene.stranger()
    stranger.challenge()
    stranger.send("command", seq=2**50, answers=scene.operator.seen["seq"], values=FULL)
    return stranger.refusal()


@refused("must be a hello")
def emergency_stop_before_hello(scene: Scene) -> str:
    """Only clients with the key may stop the robot over the network."""
    stranger = scene.stranger()
    stranger.challenge()
    stranger.send("emergencystop", reason="nuisance")
    reason = stranger.refusal()
    assert not scene.operator.observe()["emergency"]
    return reason


@refused("version")
def other_version(scene: Scene) -> str:
    """Speak a version of the link with other rules."""
    return scene.knock(scene.key, version=0)


@refused("Not a valid message")
def fields_of_another_type(scene: Scene) -> str:
    """Send a list for the version."""
    return scene.knock(scene.key, version=[1])


# Below the link.


@refused("closed")
def plain_http(scene: Scene) -> str:
    """Ask without TLS."""
    return scene.stranger(version=None).upgrade() or "closed"


@refused("closed")
def old_tls(scene: Scene) -> str:
    """Offer TLS 1.2 at most."""
    with pytest.raises((ssl.SSLError, ConnectionResetError)):
        scene.stranger(version=ssl.TLSVersion.TLSv1_2)
    return "closed"


@refused("closed")
def garbage_for_tls(scene: Scene) -> str:
    """Send random bytes in place of a handshake."""
    stranger = scene.stranger(version=None)
    stranger.write(os.urandom(4096))
    stranger.read(2**16)
    return "closed" if not stranger.read(1) else "open"


@refused("403")
def foreign_origin(scene: Scene) -> str:
    """Open the link from a web page of another server."""
    return scene.stranger().upgrade(Origin="https://evil.example")


@refused("403")
def null_origin(scene: Scene) -> str:
    """Open the link from a local file or a sandboxed frame."""
    return scene.stranger().upgrade(Origin="null")


@refused("403")
def origin_of_another_port(scene: Scene) -> str:
    """Open the link from another server of the robot's computer."""
    return scene.stranger().upgrade(Origin=f"https://127.0.0.1:{scene.port + 1}")


PATHS = (
    "/../credentials/key",
    "/console/../../credentials/key",
    "/console/..%2f..%2fcredentials%2fkey",
    "/console/%2e%2e/%2e%2e/credentials/key",
    "/console/....//....//credentials/key",
    "/console/%00",
    "/credentials/key",
    "//etc/passwd",
    "/console/",
    "/link/../healthz",
)


@refused("404")
def paths(scene: Scene) -> str:
    """Ask for files outside of the console."""
    found = {scene.stranger().request(f"GET {path} HTTP/1.1") for path in PATHS}
    assert {status.split()[1] for status in found} <= {"400", "404"}, found
    return "".join(found)


@refused("405")
def methods(scene: Scene) -> str:
    """Write, delete and configure."""
    found = {
        scene.stranger().request(f"{method} {path} HTTP/1.1", Content_Length="0")
        for method in ("POST", "PUT", "DELETE", "PATCH", "OPTIONS", "TRACE")
        for path in ("/link", "/console/robot.json")
    }
    assert {status.split()[1] for status in found} == {"405"}, found
    return "".join(found)


@refused("400")
def half_an_upgrade(scene: Scene) -> str:
    """Open the link without the headers of a WebSocket."""
    return scene.stranger().request("GET /link HTTP/1.1", Upgrade="websocket")


@refused("400")
def smuggled_request(scene: Scene) -> str:
    """Send two contradictory lengths."""
    headers = {"Content_Length": "4", "Transfer_Encoding": "chunked"}
    return scene.stranger().request("GET /healthz HTTP/1.1", **headers)


@refused("400")
def huge_header(scene: Scene) -> str:
    """Send a header of a megabyte."""
    return scene.stranger().request("GET / HTTP/1.1", X="x" * 2**20) or "400"


# Frames and messages, without and with the key.


def framed(scene: Scene, *frames: bytes) -> str:
    """Send frames without and with the key, and return how both connections end."""
    ends: list[str] = []
    for stranger in (scene.stranger(), scene.inside()):
        if not stranger.nonce:
            stranger.challenge()
        for each in frames:
            stranger.write(each)
        ends.append(stranger.refusal())
    return ends[0] if ends[0] == ends[1] else " | ".join(ends)


@refused("closed")
def huge_claim(scene: Scene) -> str:
    """Announce a message of 2^62 bytes."""
    return framed(scene, header(2**62), bytes(1000))


@refused("larger than")
def large_message(scene: Scene) -> str:
    """Send a message above the limit of 64 KiB."""
    return framed(scene, frame(bytes(64 * 1024 + 1)))


@refused("closed")
def endless_fragments(scene: Scene) -> str:
    """Send fragments of one message until the robot gives up."""
    parts = [frame(bytes(1024), BINARY if not n else 0, end=False) for n in range(1024)]
    return framed(scene, *parts)


@refused("closed")
def interleaved_fragments(scene: Scene) -> str:
    """Begin a message within another."""
    return framed(scene, frame(b"\x81", end=False), frame(b"\x81", end=False))


@refused("closed")
def continuation_of_nothing(scene: Scene) -> str:
    """Continue a message that was not begun."""
    return framed(scene, frame(b"\x81", 0))


@refused("closed")
def reserved_bits(scene: Scene) -> str:
    """Send a frame as if compression had been agreed on."""
    return framed(scene, frame(b"\x81", flags=0x40))


@refused("closed")
def unknown_opcode(scene: Scene) -> str:
    """Send a frame of an undefined kind."""
    return framed(scene, frame(b"\x81", 3))


@refused("closed")
def large_ping(scene: Scene) -> str:
    """Send a control frame above the limit of RFC 6455."""
    return framed(scene, frame(bytes(126), PING))


@refused("binary messages")
def text_message(scene: Scene) -> str:
    """Send JSON."""
    return framed(scene, frame(b'{"kind":"emergencystop"}', TEXT))


BODIES = {
    "array_that_claims_4_billion": b"\xdd\xff\xff\xff\xff",
    "map_that_claims_4_billion": b"\xdf\xff\xff\xff\xff",
    "text_that_claims_4_gib": b"\x81\xa4kind\xdb\xff\xff\xff\xff",
    "deep_nesting": b"\x91" * 60_000,
    "invalid_utf_8": b"\x81\xa4kind\xa4\xff\xfe\xfd\xfc",
    "message_of_a_robot": msgspec.msgpack.encode({"kind": "lease", "mine": True, "holder": "me"}),
    "cut_off": msgspec.msgpack.encode({"kind": "command", "seq": 1, "answers": 1})[:-2],
    "empty": b"",
}


def body(name: str) -> Attack:
    """Return an attack that sends a malformed message."""
    return lambda scene: framed(scene, frame(BODIES[name]))


for malformed in BODIES:
    ATTACKS[malformed] = body(malformed), "Not a valid message"


# With the key, against a person who has control.


@refused("sent already")
def second_hello(scene: Scene) -> str:
    """Change the role after the introduction."""
    thief = scene.inside()
    known = proof(scene.key, thief.nonce, thief.certificate, "person")
    thief.send("hello", version=1, proof=known, role="person")
    return thief.refusal()


@refused("do not have control")
def command_without_control(scene: Scene) -> str:
    """Command while another client has control."""
    thief = scene.inside()
    thief.drive(2**50, *FULL)
    return thief.refusal()


@refused("do not have control")
def injected_fields(scene: Scene) -> str:
    """Claim the session and the lease of the operator."""
    thief = scene.inside()
    thief.drive(2**50, *FULL, session=1, mine=True, holder="Grace", lease=1, role="person")
    return thief.refusal()


@refused("cannot take it from a person")
def program_takes_from_a_person(scene: Scene) -> str:
    """Ask for control of a robot that a person drives."""
    lease = scene.inside().take()
    assert not lease["mine"]
    return lease["reason"]


@refused("cannot take it from a person")
def two_operators(scene: Scene) -> str:
    """Ask for control as a second person, and command all the same."""
    thief = scene.inside("person")
    lease = thief.take()
    assert not lease["mine"]
    thief.drive(2**50, *FULL)
    assert "do not have control" in thief.refusal()
    return lease["reason"]


@refused("Only a person can record")
def program_records(scene: Scene) -> str:
    """Fill the robot's disk."""
    thief = scene.inside()
    thief.send("record", on=True, name="x" * 64)
    return thief.refusal()


@refused("Not a valid message")
def recordings_elsewhere(scene: Scene) -> str:
    """Ask for files outside of the folder of the recordings."""
    reasons: set[str] = set()
    for name in ("../credentials", "a/../../credentials", ".", "/etc", "a\x00b", "..", "a\n"):
        thief = scene.inside()
        thief.send("fetch", episode=name)
        reasons.add(thief.refusal().partition(":")[0])
    assert len(reasons) == 1
    return reasons.pop()


@refused("Too many messages")
def flood(scene: Scene) -> str:
    """Send pings as fast as the network takes them."""
    thief = scene.inside()
    message = frame(msgspec.msgpack.encode({"kind": "ping", "token": 1}))
    for _ in range(20):
        thief.write(message * 100)
    return thief.refusal()


@refused("Suggest")
def suggestions(scene: Scene) -> str:
    """Suggest, as any client may; the robot shows and does not apply it."""
    thief = scene.inside()
    thief.send("suggest", seq=1, answers=thief.observe()["seq"], values=FULL)
    thief.send("suggest", seq=1, answers=thief.seen["seq"], values=FULL)
    return thief.refusal()


# Within the operator's own session: what a recorder of its messages, or a bug, could send.


def repeated(scene: Scene, **fields: object) -> str:
    """Command full speed with some fields changed, after a command to rest; return the refusal."""
    operator = scene.operator
    operator.drive(5, 0.0, 0.0)
    seen = operator.expect("observation")
    operator.send("command", **({"seq": 6, "answers": seen["seq"], "values": FULL} | fields))
    return operator.refusal()


@refused("not newer than 5")
def replayed_command(scene: Scene) -> str:
    """Repeat the number of the last command."""
    return repeated(scene, seq=5)


@refused("not newer than 5")
def stale_sequence(scene: Scene) -> str:
    """Send a command that was overtaken."""
    return repeated(scene, seq=4)


@refused("Not a valid message")
def sequence_beyond_the_range(scene: Scene) -> str:
    """Send a number that a later one could not exceed."""
    return repeated(scene, seq=2**53 + 1)


@refused("was not sent to this client")
def answer_to_the_future(scene: Scene) -> str:
    """Answer an observation that was not sent yet."""
    return repeated(scene, answers=2**52)


@refused("was not sent to this client")
def answer_to_the_distant_past(scene: Scene) -> str:
    """Answer an observation of another client, or from before the last 64."""
    return repeated(scene, answers=0)


@refused("ms are allowed")
def answer_to_an_old_observation(scene: Scene) -> str:
    """Delay a command until nobody knows what the robot sees."""
    operator = scene.operator
    seen = operator.observe()
    settle(scene.robot, scene.key, 450_000_000)
    operator.send("command", seq=7, answers=seen["seq"], values=FULL)
    return operator.refusal()


@refused("Not armed.")
def late_request_to_arm(scene: Scene) -> str:
    """Arm with an observation that is old."""
    operator = scene.operator
    operator.send("disarm")
    seen = operator.observe()
    settle(scene.robot, scene.key, 450_000_000)
    operator.send("arm", answers=seen["seq"])
    return operator.refusal()


UNUSABLE = {
    "not_a_number": ({"values": (0.0, math.nan)}, "must be finite"),
    "infinite": ({"values": (math.inf, 1.0)}, "must be finite"),
    "enormous": ({"values": (0.0, 1e300)}, "must be finite"),
    "too_few_values": ({"values": (1.0,)}, "has 2 values"),
    "too_many_values": ({"values": (1.0,) * 64}, "has 2 values"),
    "more_values_than_the_link_takes": ({"values": (1.0,) * 65}, "Not a valid message"),
    "everlasting": ({"ttl_ms": 2**31}, "Not a valid message"),
    "scaled_up": ({"scale": 2.0}, "Not a valid message"),
    "text_for_a_number": ({"values": ("1.0", "1.0")}, "Not a valid message"),
}


def unusable(name: str) -> Attack:
    """Return an attack that sends a command with impossible fields."""
    return lambda scene: repeated(scene, **UNUSABLE[name][0])


for invalid, (_, complaint) in UNUSABLE.items():
    ATTACKS[invalid] = unusable(invalid), complaint


@pytest.mark.parametrize("name", ATTACKS)
def test_an_attack_is_refused_without_a_movement(scene: Scene, name: str) -> None:
    """The robot says why, or closes the connection."""
    attack, words = ATTACKS[name]
    assert words.lower() in attack(scene).lower()


# Many at once. The limits before a hello are 16 connections per address and 48 in all.


def knocks(scene: Scene, source: str) -> Stranger:
    """Guess a key, and do not wait for the answer."""
    stranger = scene.stranger(source=source)
    stranger.hello(os.urandom(16), "person")
    return stranger


def says_nothing(scene: Scene, source: str) -> Stranger:
    """Connect alone, without a handshake."""
    return scene.stranger(source=source, version=None)


def half_a_handshake(scene: Scene, source: str) -> Stranger:
    """Send the beginning of a TLS handshake."""
    stranger = scene.stranger(source=source, version=None)
    stranger.write(b"\x16\x03\x01\x02\x00\x01")
    return stranger


def half_a_request(scene: Scene, source: str) -> Stranger:
    """Send a request without its end."""
    stranger = scene.stranger(source=source)
    stranger.write(b"GET /link HTTP/1.1\r\nHost: x\r\n")
    return stranger


def half_a_hello(scene: Scene, source: str) -> Stranger:
    """Open the link, and send the beginning of a hello."""
    stranger = scene.stranger(source=source)
    stranger.challenge()
    stranger.write(header(100) + b"\x81\xa4kind")
    return stranger


def thief_without_a_word(scene: Scene, source: str) -> Stranger:
    """Connect as a person with the key, and read nothing from then on."""
    stranger = scene.stranger(source=source)
    stranger.hello(scene.key, "person", name="thief")
    return stranger


def thief_in_half_a_message(scene: Scene, source: str) -> Stranger:
    """Connect as a person with the key, and never finish a message."""
    stranger = thief_without_a_word(scene, source)
    stranger.write(header(1000))
    return stranger


HOLDS = (
    knocks,
    says_nothing,
    half_a_handshake,
    half_a_request,
    half_a_hello,
    thief_without_a_word,
    thief_in_half_a_message,
)


@pytest.mark.parametrize("hold", HOLDS, ids=lambda hold: hold.__name__)
def test_a_person_stops_the_robot_whoever_holds_its_connections(
    scene: Scene, hold: Callable[[Scene, str], Stranger]
) -> None:
    """With 48 connections of six addresses held, or eight of clients with the key."""
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
    """The time for a request and for a hello counts from its beginning."""
    slow = [hold(scene, source) for source in ELSEWHERE]
    while slow:
        for stranger in slow:
            stranger.write(b"x")
        scene.operator.observe()
        slow = [stranger for stranger in slow if stranger.is_open()]


# What a thief of the key can do, and cannot.


def test_a_thief_of_the_key_stays_within_the_limits_of_the_guard(robot: RunningRobot) -> None:
    """Full speed for a minute is the profile's speed until the deadline; then the robot rests."""
    key = key_bytes((robot.folder / "credentials" / "key").read_text())
    before = len(read_ledger(robot.ledger_path))
    with Stranger(robot.port) as thief:
        thief.enter(key, "person", name="thief")
        while not thief.take()["mine"]:
            pass
        thief.arm()
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


def test_any_client_with_the_key_stops_a_thief(robot: RunningRobot) -> None:
    """A program stops a person; only a client that claims to be a person goes on."""
    key = key_bytes((robot.folder / "credentials" / "key").read_text())
    with Stranger(robot.port) as thief, Stranger(robot.port) as program:
        thief.enter(key, "person", name="thief")
        while not thief.take()["mine"]:
            pass
        thief.arm()
        program.enter(key, name="watchdog")
        program.send("emergencystop", reason="nobody should drive")
        while not (seen := thief.observe())["emergency"]:
            pass
        before = movements(robot)
        thief.drive(1, *FULL)
        assert "Emergency stop" in thief.refusal()
        program.send("arm", answers=program.observe()["seq"], emergency=seen["emergencies"])
        assert "Only a person" in program.refusal()
        thief.send("arm", answers=thief.observe()["seq"], emergency=seen["emergencies"] - 1)
        assert "emergency stops" in thief.refusal()
        assert movements(robot) == before


def test_no_log_contains_a_key_or_a_proof(robot: RunningRobot) -> None:
    """Nor do command lines, environments, pages and files outside of the credentials' folder."""
    text = (robot.folder / "credentials" / "key").read_text().strip()
    private = (robot.folder / "credentials" / "certificate.key").read_text().splitlines()[1:-1]
    key = key_bytes(text)
    secrets = [key]
    for held, role in ((key, "person"), (key, "program"), (WRONG, "person")):
        with Stranger(robot.port) as client:
            client.hello(held, role, name="Lin\nguard: Armed.\x1b[2J")
            client.receive()
            secrets.append(client.proof)
    with Stranger(robot.port) as client:
        page = client.request("GET / HTTP/1.1", Connection="close") + client.rest()
    with Stranger(robot.port) as client:
        page += (
            client.request("GET /console/robot.json HTTP/1.1", Connection="close") + client.rest()
        )
    log = robot.log_text()
    processes = [robot.supervisor.pid, robot.pid_of("guard"), robot.pid_of("daemon")]
    places = {f"/proc/{pid}/{name}" for pid in processes for name in ("cmdline", "environ")}
    places |= {
        str(p) for p in robot.folder.rglob("*") if p.is_file() and p.parent.name != "credentials"
    }
    written = b"".join(Path(place).read_bytes() for place in sorted(places)) + page.encode()
    forms = [*private, text, text.replace("-", ""), text.lower()]
    forms += [form(secret) for secret in secrets for form in (bytes.hex, repr, base64_of)]
    assert "Lin guard: Armed. [2J, a person, connected" in log
    assert "Wrong key" in log
    assert b"shapechanger" in written
    found = [form for form in forms if form.encode() in written]
    assert found == []
    assert not any(secret in written for secret in secrets)


def base64_of(secret: bytes) -> str:
    """Return bytes in base 64 without padding."""
    return base64.b64encode(secret).decode().rstrip("=")


def test_an_honest_client_moves_the_robot(robot: RunningRobot) -> None:
    """The same client, by the rules: the ledger shows what the attacks did not achieve."""
    key = key_bytes((robot.folder / "credentials" / "key").read_text())
    before = movements(robot)
    with Stranger(robot.port) as operator:
        operator.enter(key, "person", name="Grace")
        while not operator.take()["mine"]:
            pass
        operator.arm()
        for seq in itertools.count(1):
            operator.drive(seq, 0.0, 0.5)
            if operator.expect("observation")["applied_seq"]:
                break
    assert movements(robot) > before
