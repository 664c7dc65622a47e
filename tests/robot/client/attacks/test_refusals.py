"""Attacks that a served robot refuses without a movement, each by its name."""

import math
import ssl
from collections.abc import Callable
from typing import Any, Final

import msgspec.msgpack
import pytest

from tests.robot.client.attacks.scene import FULL, Scene, settle
from tests.robot.client.attacks.stranger import BINARY, TEXT, Stranger, frame, header, proof

pytestmark = [pytest.mark.system, pytest.mark.realtime]

Attack = Callable[[Scene], str]
ATTACKS: dict[str, tuple[Attack, str]] = {}


def refused(text: str) -> Callable[[Attack], Attack]:
    """Register an attack that must return a text with `words`."""

    def register(attack: Attack) -> Attack:
        ATTACKS[attack.__name__] = attack, text
        return attack

    return register


def passed_on(scene: Scene, made_as: str, certificate: bytes | None = None) -> Stranger:
    """Say hello as a person with a proof that an honest client has made otherwise."""
    stranger = scene.stranger()
    seen = stranger.certificate if certificate is None else certificate
    made = proof(scene.key, stranger.challenge(), seen, made_as)
    stranger.send("hello", version=1, proof=made, role="person")
    return stranger


# Without the key.

ATTACKS |= {
    "no_proof": (lambda scene: scene.knock(proof=b""), "Wrong key"),
    "wrong_key": (lambda scene: scene.knock(), "Wrong key"),
    "other_version": (lambda scene: scene.knock(scene.key, version=0), "version"),
    "role_swap": (lambda scene: passed_on(scene, "program").refusal(), "Wrong key"),
    "man_in_the_middle": (
        lambda scene: passed_on(scene, "person", certificate=b"\x01" * 32).refusal(),
        "Wrong key",
    ),
}


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


def before_hello(scene: Scene, kind: str, **fields: Any) -> str:
    """Order without a hello: only clients with the key may even stop the robot."""
    stranger = scene.stranger()
    stranger.challenge()
    stranger.send(kind, **fields)
    reason = stranger.refusal()
    assert not scene.operator.observe()["emergency"]
    return reason


ATTACKS |= {
    "command_before_hello": (
        lambda scene: before_hello(
            scene, "command", seq=2**50, answers=scene.operator.seen["seq"], values=FULL
        ),
        "must be a hello",
    ),
    "emergency_stop_before_hello": (
        lambda scene: before_hello(scene, "emergencystop", reason="nuisance"),
        "must be a hello",
    ),
}


# Below the link.


@refused("closed")
def old_tls(scene: Scene) -> str:
    with pytest.raises((ssl.SSLError, ConnectionResetError)):
        scene.stranger(version=ssl.TLSVersion.TLSv1_2)
    return "closed"


ATTACKS |= {
    "plain_http": (lambda scene: scene.stranger(version=None).upgrade() or "closed", "closed"),
    "foreign_origin": (
        lambda scene: scene.stranger().upgrade(Origin="https://evil.example"),
        "403",
    ),
}

PATHS = (
    "/../credentials/key",
    "/console/../../credentials/key",
    "/console/..%2f..%2fcredentials%2fkey",
    "/credentials/key",
    "//etc/passwd",
    "/console/",
)


@refused("404")
def paths(scene: Scene) -> str:
    found = {scene.stranger().request(f"GET {path} HTTP/1.1") for path in PATHS}
    assert {status.split()[1] for status in found} <= {"400", "404"}, found
    return "".join(found)


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


FRAMES: Final[dict[str, tuple[str, list[bytes]]]] = {
    "huge_claim": ("closed", [header(2**62), bytes(1000)]),
    "large_message": ("larger than", [frame(bytes(64 * 1024 + 1))]),
    "endless_fragments": (
        "closed",
        [frame(bytes(1024), 0 if n else BINARY, end=False) for n in range(1024)],
    ),
    "text_message": ("binary messages", [frame(b'{"kind":"emergencystop"}', TEXT)]),
}
BODIES: Final = {
    "array_that_claims_4_billion": b"\xdd\xff\xff\xff\xff",
    "deep_nesting": b"\x91" * 60_000,
    "invalid_utf_8": b"\x81\xa4kind\xa4\xff\xfe\xfd\xfc",
    "message_of_a_robot": msgspec.msgpack.encode({"kind": "lease", "mine": True, "holder": "me"}),
}


FRAMES.update({name: ("Not a valid message", [frame(body)]) for name, body in BODIES.items()})
ATTACKS.update(
    {
        name: (lambda scene, sent=sent: framed(scene, *sent), words)
        for name, (words, sent) in FRAMES.items()
    }
)


# With the key, against a person who has control.


def by_a_thief(**fields: Any) -> Attack:
    """Return an attack that commands with the key."""

    def attack(scene: Scene) -> str:
        thief = scene.inside()
        thief.drive(2**50, *FULL, **fields)
        return thief.refusal()

    return attack


INJECTED: Final = {"session": 1, "mine": True, "holder": "Grace", "lease": 1, "role": "person"}
ATTACKS |= {
    "command_without_control": (by_a_thief(), "do not have control"),
    "injected_fields": (by_a_thief(**INJECTED), "do not have control"),
}


@refused("sent already")
def second_hello(scene: Scene) -> str:
    """Change the role after the introduction."""
    thief = scene.inside()
    known = proof(scene.key, thief.nonce, thief.certificate, "person")
    thief.send("hello", version=1, proof=known, role="person")
    return thief.refusal()


@pytest.mark.parametrize("role", ["program", "person"])
def test_control_is_not_taken_from_a_person(scene: Scene, role: str) -> None:
    thief = scene.inside(role)
    lease = thief.take()
    assert not lease["mine"]
    assert "cannot take it from a person" in lease["reason"]
    thief.drive(2**50, *FULL)
    assert "do not have control" in thief.refusal()


# Within the operator's own session: what a recorder of its messages, or a bug, could send.


def repeated(scene: Scene, **fields: object) -> str:
    """Command full speed with some fields changed, after a command to rest; return the refusal."""
    operator = scene.operator
    operator.drive(5, 0.0, 0.0)
    seen = operator.expect("observation")
    operator.send("command", **({"seq": 6, "answers": seen["seq"], "values": FULL} | fields))
    return operator.refusal()


def too_late(scene: Scene, kind: str, **fields: object) -> str:
    """Answer an observation so late that nobody knows what the robot sees."""
    operator = scene.operator
    if kind == "arm":
        operator.send("disarm")
    seen = operator.observe()
    settle(scene.robot, scene.key, 450_000_000)
    operator.send(kind, answers=seen["seq"], **fields)
    return operator.refusal()


ATTACKS |= {
    "answer_to_an_old_observation": (
        lambda scene: too_late(scene, "command", seq=7, values=FULL),
        "ms are allowed",
    ),
    "late_request_to_arm": (lambda scene: too_late(scene, "arm"), "Not armed."),
}


UNUSABLE: Final[dict[str, tuple[dict[str, Any], str]]] = {
    "replayed_command": ({"seq": 5}, "not newer than 5"),
    "answer_to_the_future": ({"answers": 2**52}, "was not sent to this client"),
    "answer_to_the_distant_past": ({"answers": 0}, "was not sent to this client"),
    "not_a_number": ({"values": (0.0, math.nan)}, "must be finite"),
    "too_few_values": ({"values": (1.0,)}, "has 2 values"),
    "scaled_up": ({"scale": 2.0}, "Not a valid message"),
}


ATTACKS.update(
    {
        name: (lambda scene, fields=fields: repeated(scene, **fields), words)
        for name, (fields, words) in UNUSABLE.items()
    }
)


@pytest.mark.parametrize("name", ATTACKS)
def test_an_attack_is_refused_without_a_movement(scene: Scene, name: str) -> None:
    attack, text = ATTACKS[name]
    assert text.lower() in attack(scene).lower()
