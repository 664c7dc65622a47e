"""Fingerprints as people compare them."""

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
def test_a_fingerprint_is_read_as_it_is_written(certificate: bytes) -> None:
    """In digits, in capitals and with colons as OpenSSL writes it."""
    fingerprint = fingerprint_of(certificate)
    text = fingerprint_hex(fingerprint)
    pairs = ":".join(text[i : i + 2] for i in range(0, len(text), 2)).upper()
    assert parse_fingerprint(text) == parse_fingerprint(pairs) == fingerprint


def test_the_short_one_has_four_groups() -> None:
    """Short enough to read aloud, long enough that nobody makes a second one."""
    short = fingerprint_short(fingerprint_of(b"certificate"))
    assert [len(group) for group in short.split("-")] == [4, 4, 4, 4]


@pytest.mark.parametrize("text", ["", "ab" * 31, "ab" * 33, "zz" * 32])
def test_what_is_no_fingerprint_is_refused(text: str) -> None:
    """The message says where to find the right one."""
    with pytest.raises(LinkError, match="64 hexadecimal digits"):
        parse_fingerprint(text)
