"""The key of a robot, and the proof that somebody holds it, without ever sending it.

The robot sends a nonce, and the client answers with HMAC-SHA256 (RFC 2104) of the nonce, of the
certificate that it sees, and of who it says it is. Somebody in the middle, with a certificate of
their own, gets an answer that the robot does not take; an answer heard once fits no other nonce.
"""

from __future__ import annotations

import base64
import hashlib
import hmac
import re
import secrets
from typing import Final

from shapechanger.errors import LinkError

__all__ = [
    "NONCE_BYTES",
    "fingerprint_hex",
    "fingerprint_of",
    "fingerprint_short",
    "is_proof",
    "make_proof",
    "new_key",
    "new_nonce",
    "parse_fingerprint",
    "parse_key",
]

NONCE_BYTES: Final = 32
"""Bytes of a nonce; never two the same."""

_KEY_BYTES: Final = 16  # 128 bits, which nobody guesses.
_KEY_CHARACTERS: Final = 26  # 16 bytes in base 32 (RFC 4648) without its padding.
_GROUP: Final = 4
_PURPOSE: Final = b"shapechanger link 1"  # A proof for this use fits no other use of the key.

# What people write for a letter or number that is not in base 32.
_MISREAD: Final = str.maketrans({"0": "O", "1": "I", "8": "B", "-": "", " ": "", "\n": ""})


def new_key() -> str:
    """A new random key: 26 letters and numbers in groups of four, which people can copy."""
    text = base64.b32encode(secrets.token_bytes(_KEY_BYTES)).decode().rstrip("=")
    return "-".join(text[i : i + _GROUP] for i in range(0, len(text), _GROUP))


def parse_key(text: str) -> bytes:
    """The bytes of a key as people write it; groups, spaces and small letters do not matter.

    Raises:
        LinkError: If it is no key.
    """
    plain = text.strip().upper().translate(_MISREAD)
    if len(plain) != _KEY_CHARACTERS:
        raise LinkError(
            f"A key has {_KEY_CHARACTERS} letters and numbers, this one has {len(plain)}."
        )
    try:
        key = base64.b32decode(plain + "=" * (-len(plain) % 8))
    except ValueError:
        raise LinkError("A key has only the letters A to Z and the numbers 2 to 7.") from None
    if base64.b32encode(key).decode().rstrip("=") != plain:
        raise LinkError("This key has a wrong last letter.")
    return key


def new_nonce() -> bytes:
    """Random bytes that were never used before."""
    return secrets.token_bytes(NONCE_BYTES)


def make_proof(key: bytes, nonce: bytes, certificate: bytes, role: str) -> bytes:
    """What a client answers to a challenge.

    Args:
        key: The key, as `parse_key` gives it.
        nonce: The nonce of the challenge.
        certificate: SHA-256 of the robot's certificate (DER) as the client sees it; empty without
            TLS.
        role: The role in the client's `Hello`, so that nobody on the way makes a person of a
            program.
    """
    digest = hmac.new(key, digestmod="sha256")
    for part in (_PURPOSE, nonce, certificate, role.encode()):
        digest.update(len(part).to_bytes(4, "big") + part)  # With lengths, nothing can shift.
    return digest.digest()


def is_proof(proof: bytes, key: bytes, nonce: bytes, certificate: bytes, role: str) -> bool:
    """Whether a client holds the key; how long this takes tells nothing about the answer."""
    return hmac.compare_digest(proof, make_proof(key, nonce, certificate, role))


_SHORT_CHARACTERS: Final = 16  # 80 bits in base 32: nobody makes a second certificate with them.


def fingerprint_of(certificate_der: bytes) -> bytes:
    """SHA-256 of a certificate in DER, 32 bytes."""
    return hashlib.sha256(certificate_der).digest()


def fingerprint_hex(fingerprint: bytes) -> str:
    """The fingerprint as 64 hexadecimal digits, as programs keep it."""
    return fingerprint.hex()


def fingerprint_short(fingerprint: bytes) -> str:
    """The first 80 bits in four groups of four, such as "K7QF-2MXA-…", for people to compare."""
    text = base64.b32encode(fingerprint[:10]).decode()
    return "-".join(text[i : i + 4] for i in range(0, _SHORT_CHARACTERS, 4))


def parse_fingerprint(text: str) -> bytes:
    """Read 64 hexadecimal digits, with or without colons, spaces or hyphens between them.

    Raises:
        LinkError: If it is no fingerprint.
    """
    digits = re.sub(r"[\s:-]", "", text)
    if not re.fullmatch(r"[0-9a-fA-F]{64}", digits):
        raise LinkError(
            f"A fingerprint has 64 hexadecimal digits; {text!r} is none. "
            "`shapechanger robot key NAME` shows it on the robot."
        )
    return bytes.fromhex(digits)
