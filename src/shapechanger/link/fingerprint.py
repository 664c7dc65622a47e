"""The fingerprint of a robot's certificate, as people compare it."""

from __future__ import annotations

import base64
import hashlib
import re
from typing import Final

from shapechanger.errors import LinkError

__all__ = ["fingerprint_hex", "fingerprint_of", "fingerprint_short", "parse_fingerprint"]

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
