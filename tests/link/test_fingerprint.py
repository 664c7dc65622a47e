"""Fingerprints of certificates."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.errors import LinkError
from shapechanger.link.authentication import (
    fingerprint_hex,
    fingerprint_of,
    fingerprint_short,
    parse_fingerprint,
)


@given(certificate=st.binary(max_size=64))
def test_a_fingerprint_survives_a_round_trip(certificate: bytes) -> None:
    """As hexadecimal digits, and with colons and capitals as OpenSSL writes it."""
    fingerprint = fingerprint_of(certificate)
    text = fingerprint_hex(fingerprint)
    pairs = ":".join(text[i : i + 2] for i in range(0, len(text), 2)).upper()
    assert parse_fingerprint(text) == parse_fingerprint(pairs) == fingerprint


def test_the_short_form_has_four_groups() -> None:
    """Short enough to read aloud, long enough to be unique."""
    short = fingerprint_short(fingerprint_of(b"certificate"))
    assert [len(group) for group in short.split("-")] == [4, 4, 4, 4]


@pytest.mark.parametrize("text", ["", "ab" * 31, "ab" * 33, "zz" * 32])
def test_an_invalid_fingerprint_is_an_error(text: str) -> None:
    """The message shows the expected form."""
    with pytest.raises(LinkError, match="64 hexadecimal digits"):
        parse_fingerprint(text)
