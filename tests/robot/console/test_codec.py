"""The console and the robot agree on messages and proofs."""

import base64
import math
from collections.abc import Callable
from typing import Any

import msgspec
import pytest

from shapechanger.robot.link import messages as m
from shapechanger.robot.link.authentication import make_proof, new_key, parse_key
from shapechanger.robot.twin.robot import RunningRobot
from tests.robot.console.browser import Console

pytestmark = [pytest.mark.realtime, pytest.mark.system]

Visit = Callable[..., Console]

# Script that decodes and encodes values again; integers beyond 2^53 become BigInt.
_AGAIN = """async (texts) => {
  const { decode, encode } = await import("/console/codec.js");
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const text = (bytes) => btoa(Array.from(bytes, (b) => String.fromCharCode(b)).join(""));
  return texts.map((each) => {
    try { return text(encode(decode(bytes(each)))); } catch (error) { return `${error.name}`; }
  });
}"""

_VALUES: list[Any] = [
    None,
    True,
    False,
    *(sign * (2**power + step) for power in range(64) for step in (-1, 0) for sign in (1, -1)),
    2**64 - 1,
    -(2**63),
    0.1,
    -1e300,
    math.inf,
    "",
    "Grüße, 机器人 🤖",
    *("x" * n for n in (31, 32, 255, 256, 65535, 65536)),
    *(b"\xff" * n for n in (0, 1, 255, 256, 65535, 65536)),
    *([n % 7] * n for n in (0, 15, 16, 65536)),
    *({f"{i}": i for i in range(n)} for n in (0, 15, 16, 65536)),
    {"__proto__": {"constructor": [1, {"a": None}]}},
]


def _again(console: Console, *packed: bytes) -> list[str]:
    return console.page.evaluate(_AGAIN, [base64.b64encode(each).decode() for each in packed])


def test_every_value_survives_a_round_trip(car: RunningRobot, visit: Visit) -> None:
    packed = [msgspec.msgpack.encode(value) for value in _VALUES]
    for value, text in zip(_VALUES, _again(visit(car, key=""), *packed), strict=True):
        assert msgspec.msgpack.decode(base64.b64decode(text)) == value


def test_broken_bytes_are_refused(car: RunningRobot, visit: Visit) -> None:
    console = visit(car, key="")
    whole = m.encode(m.Pong(token=1, now_ns=2**40))
    broken = [whole[:-1], whole + b"\xc0", b"", b"\x91" * 100 + b"\xc0", b"\xc1", b"\xd4\x00\x00"]
    broken += [b"\xdd\xff\xff\xff\xff", b"\xc6\xff\xff\xff\xff", b"\x81\x01\x02"]
    assert _again(console, *broken) == ["RangeError"] * len(broken)


def test_the_page_computes_the_robots_proof(car: RunningRobot, visit: Visit) -> None:
    """Proofs are equal for keys in any notation, with or without a certificate."""
    console = visit(car, key="")
    cases = [(new_key(), bytes(range(32)), certificate) for certificate in (b"", b"\x01" * 32)]
    for key, nonce, certificate in cases:
        made = console.page.evaluate(
            """async ([key, nonce, certificate]) => {
              const { fromHex, makeProof, parseKey } = await import("/console/proof.js");
              const proof = await makeProof(
                parseKey(key), fromHex(nonce), fromHex(certificate), "person");
              return [Array.from(parseKey(key)), Array.from(proof)];
            }""",
            [key.lower().replace("-", " "), nonce.hex(), certificate.hex()],
        )
        proof = make_proof(parse_key(key), nonce, certificate, "person")
        assert made == [list(parse_key(key)), list(proof)]
    version = "async () => (await import('/console/link.js')).VERSION"
    assert console.page.evaluate(version) == m.VERSION
