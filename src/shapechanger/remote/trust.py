"""Who it is that answers: the fingerprint is checked, or it is shown to a person to compare.

Nothing is trusted on first use. A program cannot tell the robot from somebody who stands in
between; a person who looks at both fingerprints can.
"""

from __future__ import annotations

import ssl
from typing import Final

from shapechanger.errors import LinkError
from shapechanger.link.address import Address
from shapechanger.link.fingerprint import fingerprint_hex, fingerprint_of, fingerprint_short
from shapechanger.link.fingerprint import parse_fingerprint as _parse_fingerprint

__all__ = ["INSECURE", "parse_trust", "shown_fingerprint", "untrusted"]

INSECURE: Final = "insecure"
"""In the place of a fingerprint: no encryption, and no proof of who answers."""


def parse_trust(fingerprint: str) -> bytes | None:
    """SHA-256 of the certificate to expect; None for "insecure".

    Raises:
        LinkError: If it is neither a fingerprint nor that word.
    """
    return None if fingerprint == INSECURE else _parse_fingerprint(fingerprint)


def shown_fingerprint(address: Address, timeout_s: float) -> bytes:
    """SHA-256 of the certificate that is shown at an address, whoever shows it.

    Raises:
        LinkError: If nobody shows one.
    """
    try:
        shown = ssl.get_server_certificate((address.host, address.port), timeout=timeout_s)
    except OSError as error:
        raise LinkError(f"Nobody shows a certificate at {address}: {error}.") from None
    return fingerprint_of(ssl.PEM_cert_to_DER_cert(shown))


def untrusted(address: Address, timeout_s: float) -> LinkError:
    """What to say to somebody who connects without a fingerprint.

    Raises:
        LinkError: If nobody shows one.
    """
    shown = shown_fingerprint(address, timeout_s)
    digits = fingerprint_hex(shown)
    return LinkError(
        f"Nothing says that the robot at {address} is yours. It shows the fingerprint\n"
        f"  {digits}  (in short {fingerprint_short(shown)})\n"
        "Compare it with the one that `shapechanger robot key NAME` shows on the robot. If they "
        f"are the same, run\n  shapechanger robot remember NAME {address} --fingerprint {digits}"
    )
