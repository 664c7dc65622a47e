"""Authentication: the robot's key, proofs that a client holds it, and certificate fingerprints.

The robot sends a nonce. The client answers with the HMAC-SHA256 (RFC 2104) of the nonce, of the
certificate that it sees and of its role, so the key itself is never sent. A man in the middle has
another certificate and gets a proof that the robot rejects; a recorded proof fits no other nonce.
"""

from __future__ import annotations

import base64
import hashlib
import hmac
import re
import secrets
from typing import Final

from shapechanger.errors import LinkError, translate_errors

_KEY_BYTES: Final = 16  # 128 bits, which cannot be guessed.
_KEY_CHARACTERS: Final = 26  # 16 bytes in base 32 (RFC 4648) without padding.
_PURPOSE: Final = b"shapechanger link 1"  # Separates proofs from other uses of the key.

# Characters outside base 32 that people write by mistake, and separators.
_MISREAD: Final = str.maketrans({"0": "O", "1": "I", "8": "B", "-": "", " ": "", "\n": ""})


def new_key() -> str:
    """Return a new random key: 26 letters and digits in groups of four."""
    return _in_groups(secrets.token_bytes(_KEY_BYTES))


def _in_groups(data: bytes) -> str:
    """Return bytes in base 32 without padding, in groups of four."""
    text = base64.b32encode(data).decode().rstrip("=")
    return "-".join(text[i : i + 4] for i in range(0, len(text), 4))


def parse_key(text: str) -> bytes:
    """Return the bytes of a key; hyphens, spaces, either case and 0, 1, 8 for O, I, B are accepted.

    Raises:
        LinkError: If the text is not a key.
    """
    plain = text.strip().upper().translate(_MISREAD)
    if len(plain) != _KEY_CHARACTERS:
        raise LinkError(f"A key has {_KEY_CHARACTERS} letters and digits, got {len(plain)}.")
    wrong = LinkError("A key has only the letters A to Z and the digits 2 to 7.")
    with translate_errors(ValueError, to=lambda _: wrong):
        key = base64.b32decode(plain + "=" * (-len(plain) % 8))
    if base64.b32encode(key).decode().rstrip("=") != plain:
        raise LinkError("The last letter of this key is wrong.")
    return key


def new_nonce() -> bytes:
    """Return 32 new random bytes."""
    return secrets.token_bytes(32)


def make_proof(key: bytes, nonce: bytes, certificate: bytes, role: str) -> bytes:
    """Return the answer to a challenge.

    Args:
        key: The key, from `parse_key`.
        nonce: The nonce of the challenge.
        certificate: SHA-256 of the robot's certificate (DER) as the client sees it; empty without
            TLS.
        role: The role in the client's `Hello`, so that it cannot be changed on the way.
    """
    digest = hmac.new(key, digestmod="sha256")
    for part in (_PURPOSE, nonce, certificate, role.encode()):
        digest.update(len(part).to_bytes(4, "big") + part)  # Lengths make the parts unambiguous.
    return digest.digest()


def is_proof(proof: bytes, key: bytes, nonce: bytes, certificate: bytes, role: str) -> bool:
    """Return True if a proof equals `make_proof`, by a comparison in constant time."""
    return hmac.compare_digest(proof, make_proof(key, nonce, certificate, role))


def fingerprint_of(certificate_der: bytes) -> bytes:
    """Return the SHA-256 of a certificate in DER, 32 bytes."""
    return hashlib.sha256(certificate_der).digest()


def fingerprint_short(fingerprint: bytes) -> str:
    """Return the first 80 bits in groups of four, such as "K7QF-2MXA-…", for people to compare."""
    return _in_groups(fingerprint[:10])  # 80 bits are too many to forge a second certificate.


def parse_fingerprint(text: str) -> bytes:
    """Parse 64 hexadecimal digits, with or without colons, spaces or hyphens between them.

    Raises:
        LinkError: If the text is not a fingerprint.
    """
    digits = re.sub(r"[\s:-]", "", text)
    if not re.fullmatch(r"[0-9a-fA-F]{64}", digits):
        raise LinkError(
            f"A fingerprint has 64 hexadecimal digits, got {text!r}. "
            "`shapechanger robot key NAME` shows it on the robot."
        )
    return bytes.fromhex(digits)
