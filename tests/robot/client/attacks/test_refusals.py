"""Attacks that a served robot refuses without a movement, keyed by name."""

import ssl
from collections.abc import Callable
from typing import Any, Final

import pytest

from tests.robot.client.attacks.scene import FULL, Scene
from tests.robot.client.attacks.stranger import BINARY, TEXT, Stranger, frame, header, proof

pytestmark = [pytest.mark.system, pytest.mark.realtime]

Attack = Callable[[Scene], str]
ATTACKS: dict[str, tuple[Attack, str]] = {}


def refused(text: str) -> Callable[[Attack], Attack]:
    """Register an attack; the refusal that it returns must contain `text`."""

    def register(attack: Attack) -> Attack:
        ATTACKS[attack.__name__] = attack, text
        return attack

    return register


def passed_on(scene: Scene, made_as: str, certificate: bytes | None = None) -> Stranger:
    """Say hello as a person, with a proof for another role or another certificate."""
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
    """Send a request before a hello; clients without the key cannot even stop the robot."""
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
    "deep_nesting": ("Not a valid message", [frame(b"\x91" * 60_000)]),
    "text_message": ("binary messages", [frame(b'{"kind":"emergencystop"}', TEXT)]),
}
for name, (message, sent) in FRAMES.items():
    ATTACKS[name] = (lambda scene, sent=sent: framed(scene, *sent), message)


# With the key, against a person who has control.


def by_a_thief(**fields: Any) -> Attack:
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


@pytest.mark.parametrize("name", ATTACKS)
def test_an_attack_is_refused_without_a_movement(scene: Scene, name: str) -> None:
    attack, text = ATTACKS[name]
    assert text.lower() in attack(scene).lower()
