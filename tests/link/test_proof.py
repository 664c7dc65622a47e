"""The key, and the proof that somebody holds it."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.errors import LinkError
from shapechanger.link.authentication import (
    NONCE_BYTES,
    is_proof,
    make_proof,
    new_key,
    new_nonce,
    parse_key,
)

_parts = st.binary(max_size=40)
_roles = st.sampled_from(("person", "program"))


@given(key=_parts, nonce=_parts, certificate=_parts, role=_roles)
def test_who_holds_the_key_can_prove_it(
    key: bytes, nonce: bytes, certificate: bytes, role: str
) -> None:
    """Both sides come to the same proof."""
    assert is_proof(make_proof(key, nonce, certificate, role), key, nonce, certificate, role)


@given(one=st.tuples(_parts, _parts, _parts, _roles), two=st.tuples(_parts, _parts, _parts, _roles))
def test_a_proof_fits_nothing_else(
    one: tuple[bytes, bytes, bytes, str], two: tuple[bytes, bytes, bytes, str]
) -> None:
    """Another key, nonce, certificate or role needs another proof; nothing shifts between them."""
    # HMAC fills short keys up with zeros (RFC 2104); ours all have 16 bytes.
    one, two = (one[0].ljust(64, b"\0"), *one[1:]), (two[0].ljust(64, b"\0"), *two[1:])
    assert is_proof(make_proof(*one), *two) == (one == two)


@given(proof=st.binary(max_size=64))
def test_no_guess_is_a_proof(proof: bytes) -> None:
    """Not even one of another length."""
    assert not is_proof(proof, b"k" * 16, b"n" * NONCE_BYTES, b"", "program")


def test_keys_and_nonces_are_new() -> None:
    """Never the same twice."""
    assert len({new_key() for _ in range(100)}) == 100
    assert len({new_nonce() for _ in range(100)}) == 100


def test_a_key_can_be_copied_by_hand() -> None:
    """Groups, spaces, small letters and misread numbers do not matter."""
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
    ("text", "words"),
    [
        ("", "26 letters and numbers, this one has 0"),
        ("ABCD-EFGH", "this one has 8"),
        ("A" * 25 + "9", "letters A to Z and the numbers 2 to 7"),
        ("A" * 25 + "ß", "26 letters and numbers, this one has 27"),
        ("A" * 25 + "é", "letters A to Z"),
        ("A" * 25 + "B", "wrong last letter"),
    ],
)
def test_what_is_no_key_is_refused(text: str, words: str) -> None:
    """The message says what a key looks like."""
    with pytest.raises(LinkError, match=words):
        parse_key(text)
