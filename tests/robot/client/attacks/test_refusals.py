"""Attacks that a served robot refuses without a movement, each by its name."""

from __future__ import annotations

import math
import os
import ssl
from collections.abc import Callable

import msgspec.msgpack
import pytest

from tests.robot.client.attacks.scene import FULL, Scene, settle
from tests.robot.client.attacks.stranger import BINARY, PING, TEXT, frame, header, proof

pytestmark = [pytest.mark.system, pytest.mark.realtime]

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
    """Send random bytes instead of a handshake."""
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


@refused("Only a person can start a policy")
def program_starts_a_policy(scene: Scene) -> str:
    """Let a policy on board drive."""
    thief = scene.inside()
    thief.send("runpolicy", policy="../policy")
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
    attack, words = ATTACKS[name]
    assert words.lower() in attack(scene).lower()
