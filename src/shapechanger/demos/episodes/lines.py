"""Lines that say of themselves whether they are whole."""

from __future__ import annotations

import binascii
import json
from typing import Any, Final, cast

__all__ = ["MAX_LINE", "decode_line", "encode_line", "split_lines"]

MAX_LINE: Final = 1 << 20
"""Bytes of the longest line; a longer one is no step."""

_CHECK: Final = b',"crc":"%08x"}\n'
_CHECK_SIZE: Final = len(_CHECK % 0)


def encode_line(fields: dict[str, Any]) -> bytes:
    """One line, with the CRC-32 of everything before it as its last key.

    Args:
        fields: Values that JSON can hold, at least one.
    """
    text = json.dumps(fields, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    # Half of a surrogate pair has no bytes.
    body = text.encode(errors="replace")[:-1]
    return body + _CHECK % binascii.crc32(body)


def decode_line(line: bytes) -> dict[str, Any]:
    r"""What `encode_line` was given.

    Args:
        line: One line, with its `\n`.

    Raises:
        ValueError: If it is not whole, and why.
    """
    if len(line) > MAX_LINE:
        raise ValueError(f"it has {len(line)} bytes")
    body, check = line[:-_CHECK_SIZE], line[-_CHECK_SIZE:]
    if not body or check != _CHECK % binascii.crc32(body):
        raise ValueError("it is cut off or was changed")
    fields = json.loads(body + b"}")
    if not isinstance(fields, dict):
        raise ValueError("it is no JSON object")
    return cast("dict[str, Any]", fields)


def split_lines(content: bytes) -> list[bytes]:
    r"""The lines of a file, each with its `\n`; only the last one may lack it."""
    return content.splitlines(keepends=True) if b"\r" not in content else _by_newline(content)


def _by_newline(content: bytes) -> list[bytes]:
    r"""Like `splitlines`, which would also split at a `\r` that damage has put there."""
    lines = [line + b"\n" for line in content.split(b"\n")]
    last = lines.pop()[:-1]
    return [*lines, last] if last else lines
