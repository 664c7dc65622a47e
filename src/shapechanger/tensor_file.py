"""Files of named arrays: safetensors with a JSON card and a hash. Reading one runs no code from it.

Format: github.com/huggingface/safetensors (8 bytes of length, a JSON header, then the numbers).
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import MissingExtra

try:
    from safetensors import SafetensorError
    from safetensors import numpy as safetensors
except ImportError as error:
    raise MissingExtra("safetensors", "learn") from error

_CARD: Final = "card"
_HASH: Final = "sha256"
_KIND: Final = "kind"
# A file begins with the length of its JSON header.
_LENGTH_BYTES: Final = 8
_MAX_HEADER_BYTES: Final = 2**22  # Parsed JSON takes twenty times as much memory.
_MAX_BYTES: Final = 2**28

UNREADABLE: Final = (OSError, LookupError, ValueError, SafetensorError, msgspec.MsgspecError)
"""Exceptions of `read_tensors` for files that are missing, damaged or something else."""


def tensor_bytes(tensors: Mapping[str, NDArray[Any]], card: bytes, kind: str = "") -> bytes:
    """Return the content of a file; equal arrays and cards give equal bytes.

    Args:
        tensors: The arrays by name.
        card: What they are, in JSON.
        kind: Kind of the file, such as "clone"; "" for the policies of studies.
    """
    # Safetensors keeps the bytes of an array as they lie in memory.
    arrays = {name: np.asarray(value, order="C") for name, value in tensors.items()}
    metadata = {_CARD: card.decode(), _HASH: _digest(kind, card, arrays)}
    if kind:
        metadata[_KIND] = kind
    content = safetensors.save(arrays, metadata=metadata)
    # Safetensors writes the metadata in any order: write the header again with sorted metadata.
    end = _LENGTH_BYTES + int.from_bytes(content[:_LENGTH_BYTES], "little")
    header = json.loads(content[_LENGTH_BYTES:end])
    header["__metadata__"] = dict(sorted(metadata.items()))
    text = json.dumps(header, separators=(",", ":"), ensure_ascii=False).encode()
    text += b" " * (-len(text) % _LENGTH_BYTES)
    return len(text).to_bytes(_LENGTH_BYTES, "little") + text + content[end:]


def read_tensors(path: Path, kind: str = "") -> tuple[bytes, dict[str, NDArray[Any]]]:
    """Read a file of one kind.

    Args:
        path: The file.
        kind: Its kind.

    Returns:
        The card in JSON, and the arrays by name.

    Raises:
        FileNotFoundError: If there is none.
        OSError, LookupError, ValueError, SafetensorError, msgspec.MsgspecError: If it cannot be
            read, is of another kind, or has been changed.
    """
    content = _content(path)
    length = int.from_bytes(content[:_LENGTH_BYTES], "little")
    if length > _MAX_HEADER_BYTES:
        raise ValueError("it is not a safetensors file with a card")
    metadata = _metadata(content[_LENGTH_BYTES : _LENGTH_BYTES + length])
    if (found := metadata.get(_KIND, "")) != kind:
        raise ValueError(f"it is a {found!r}" if found else "it is a policy of a study")
    if missing := {_CARD, _HASH} - metadata.keys():
        raise ValueError(f"it lacks {' and '.join(sorted(missing))}")
    tensors = safetensors.load(content)
    card = metadata[_CARD].encode()
    if _digest(kind, card, tensors) != metadata[_HASH]:
        raise ValueError("its card or its numbers do not have its hash")
    return card, tensors


def kind_of(path: Path) -> str | None:
    """Return the kind of a file from its header alone; None if it is missing or something else."""
    try:
        _require_file(path)
        with path.open("rb") as file:
            length = int.from_bytes(file.read(_LENGTH_BYTES), "little")
            return _metadata(file.read(min(length, _MAX_HEADER_BYTES))).get(_KIND, "")
    except UNREADABLE:
        return None


def _require_file(path: Path) -> None:
    """Refuse pipes and devices, which may never end; a missing file is left to who opens it."""
    if path.exists() and not path.is_file():
        raise ValueError("it is not a file")


def _content(path: Path) -> bytes:
    _require_file(path)
    if path.stat().st_size > _MAX_BYTES:
        raise ValueError(f"it is larger than {_MAX_BYTES >> 20} MiB")
    return path.read_bytes()


def _metadata(header: bytes) -> dict[str, str]:
    try:
        found = json.loads(header)["__metadata__"]
    except (ValueError, LookupError, TypeError, RecursionError) as error:
        raise ValueError("it is not a safetensors file with a card") from error
    return msgspec.convert(found, dict[str, str])


def _digest(kind: str, card: bytes, tensors: Mapping[str, NDArray[Any]]) -> str:
    """SHA-256 over kind, card, names, types, shapes and numbers."""
    digest = hashlib.sha256(f"{kind} {len(card)} ".encode() + card)
    for name in sorted(tensors):
        array = tensors[name]
        digest.update(f"{name} {array.dtype} {array.shape} ".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()
