"""Keys, proofs of possession, and fingerprints of certificates."""

import hmac

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.errors import LinkError
from shapechanger.robot.link.authentication import (
    fingerprint_of,
    fingerprint_short,
    is_proof,
    make_proof,
    new_key,
    new_nonce,
    parse_fingerprint,
    parse_key,
)

_parts = st.binary(max_size=40)
_given = st.tuples(_parts, _parts, _parts, st.sampled_from(("person", "program")))


@given(one=_given, two=_given, same=st.booleans())
def test_a_proof_is_bound_to_all_its_inputs(
    one: tuple[bytes, bytes, bytes, str], two: tuple[bytes, bytes, bytes, str], same: bool
) -> None:
    two = one if same else two
    # HMAC pads short keys with zeros (RFC 2104); real keys have 16 bytes.
    one, two = (one[0].ljust(64, b"\0"), *one[1:]), (two[0].ljust(64, b"\0"), *two[1:])
    assert is_proof(make_proof(*one), *two) == (one == two)


def test_the_proof_of_the_protocol_does_not_change() -> None:
    """Robots and clients of other versions compute the same proof."""
    key, nonce, certificate = bytes(range(16)), bytes(32), b"c" * 32
    message = b"".join(
        len(part).to_bytes(4, "big") + part
        for part in (b"shapechanger link 1", nonce, certificate, b"person")
    )
    assert make_proof(key, nonce, certificate, "person") == hmac.digest(key, message, "sha256")


def test_keys_and_nonces_are_unique() -> None:
    assert len({new_key() for _ in range(100)}) == 100
    nonces = {new_nonce() for _ in range(100)}
    assert [len(nonce) for nonce in nonces] == [32] * 100


def test_a_key_can_be_copied_by_hand() -> None:
    key = new_key()
    assert len(parse_key(key)) == 16
    for written in (
        key.lower(),
        key.replace("-", ""),
        f" {key.replace('-', ' ')}\n",
        key.replace("O", "0").replace("I", "1").replace("B", "8"),
    ):
        assert parse_key(written) == parse_key(key)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "26 letters and digits, got 0"),
        ("A" * 25 + "9", "letters A to Z and the digits 2 to 7"),
        ("A" * 25 + "ß", "26 letters and digits, got 27"),
        ("A" * 25 + "é", "letters A to Z"),
        ("A" * 25 + "B", "last letter of this key is wrong"),
    ],
)
def test_an_invalid_key_is_an_error(text: str, message: str) -> None:
    with pytest.raises(LinkError, match=message):
        parse_key(text)


@given(certificate=st.binary(max_size=64))
def test_a_fingerprint_round_trips(certificate: bytes) -> None:
    fingerprint = fingerprint_of(certificate)
    text = fingerprint.hex()
    pairs = ":".join(text[i : i + 2] for i in range(0, len(text), 2)).upper()
    assert parse_fingerprint(text) == parse_fingerprint(pairs) == fingerprint


def test_an_invalid_fingerprint_is_an_error() -> None:
    """A fingerprint has 64 hexadecimal digits; its short form, four groups of four characters."""
    short = fingerprint_short(fingerprint_of(b"certificate"))
    assert fingerprint_short(b"\x17".rjust(10, b"\0") + bytes(22)) == "AAAA-AAAA-AAAA-AAAX"
    assert [len(group) for group in short.split("-")] == [4, 4, 4, 4]
    for text in ("", "ab" * 31, "ab" * 33, "zz" * 32):
        with pytest.raises(LinkError, match="64 hexadecimal digits"):
            parse_fingerprint(text)
