"""Which web pages may open a connection: a browser would open one for any page it shows."""

from __future__ import annotations

from urllib.parse import urlsplit

from shapechanger.errors import LinkError
from shapechanger.link.address import is_loopback, parse_address

__all__ = ["origin_refusal"]


def origin_refusal(origin: str | None, host: str, *, is_open: bool) -> str:
    """Why a connection must not be opened, in words; empty if it may.

    Args:
        origin: The header `Origin`; None from a program that is no browser.
        host: The header `Host`.
        is_open: Whether the robot asks for no key. Then the name must be one that no stranger's
            name server can point at the robot (DNS rebinding).
    """
    if origin is None:
        return ""
    if urlsplit(origin).netloc.lower() != host.lower():
        return "A page of another server must not drive this robot."
    try:
        name = parse_address(host).host
    except LinkError as error:
        return str(error)
    if is_open and not (is_loopback(name) or name.endswith(".local") or _is_ip(name)):
        return "Without a key, open the page of this robot by its IP address."
    return ""


def _is_ip(name: str) -> bool:
    return ":" in name or name.replace(".", "").isdecimal()
