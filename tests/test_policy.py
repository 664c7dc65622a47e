"""Damaged and malicious policy files are refused."""

from __future__ import annotations

import json
import os
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from shapechanger.errors import PolicyError
from shapechanger.policy import load_policy, read_tensors, tensor_bytes
from tests.demos.cloning.data import clone_card

_GIB = 1 << 30
_ARRAYS = {"first": np.arange(4, dtype=np.float32), "second": np.ones((2, 2), np.float32)}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A file with two arrays."""
    made = tmp_path / "policy.safetensors"
    made.write_bytes(tensor_bytes(_ARRAYS, msgspec.json.encode(clone_card())))
    return made


def test_arrays_and_card_are_read(path: Path) -> None:
    card, arrays = read_tensors(path)
    assert card == clone_card()
    assert arrays.keys() == _ARRAYS.keys()
    for name, array in arrays.items():
        np.testing.assert_array_equal(array, _ARRAYS[name])


Header = dict[str, Any]


def _with(**fields: object) -> Callable[[Header], object]:
    return lambda header: header["first"].update(fields)


def _metadata(**fields: object) -> Callable[[Header], object]:
    return lambda header: header["__metadata__"].update(fields)


HEADERS: dict[str, Callable[[Header], object]] = {
    "overlapping arrays": _with(data_offsets=[16, 32]),
    "offsets beyond the file": _with(data_offsets=[0, 2**62]),
    "a shape of 2^64 numbers": _with(shape=[2**62, 4]),
    "numbers of eight bytes": _with(dtype="F64"),
    "a card without its hash": _metadata(card="not JSON"),
    "a wrong hash": _metadata(sha256="0" * 64),
    "no card": lambda header: header["__metadata__"].pop("card"),
    "a card with a line and a colour": _metadata(card="a\nb\x1b[31m"),
    "metadata that are a list": lambda header: header.update(__metadata__=[1]),
    "no metadata": lambda header: header.pop("__metadata__"),
}


def _refused(path: Path) -> str:
    with pytest.raises(PolicyError, match="is not a policy that") as refusal:
        load_policy(path)
    text = str(refusal.value)
    assert text.isprintable()
    return text


class _Trap:
    """Ends the test run when it is unpickled."""

    def __reduce__(self) -> tuple[Any, ...]:
        return (os._exit, (1,))


FILES: dict[str, Callable[[bytes], bytes]] = {
    "half a header": lambda content: content[:60],
    "a byte more": lambda content: content + b"x",
    "a length beyond the file": lambda content: (2**40).to_bytes(8, "little") + content[8:],
    "a header that is a list": lambda _: (2).to_bytes(8, "little") + b"[]",
    "a header nested deeply": lambda _: (10**5).to_bytes(8, "little") + b"[" * 10**5,
    "a pickle": lambda _: pickle.dumps({"hands.bias": _Trap()}),
    "a header of 5 MB": lambda _: (5 << 20).to_bytes(8, "little") + b" " * (5 << 20),
}


@pytest.mark.parametrize("name", [*HEADERS, *FILES])
def test_a_damaged_file_is_refused(path: Path, name: str) -> None:
    content = path.read_bytes()
    path.write_bytes(FILES[name](content) if name in FILES else _forged(content, HEADERS[name]))
    _refused(path)


def _forged(content: bytes, change: Callable[[Header], object]) -> bytes:
    """Return a file with another header."""
    length = int.from_bytes(content[:8], "little")
    header = json.loads(content[8 : 8 + length])
    change(header)
    text = json.dumps(header).encode()
    return len(text).to_bytes(8, "little") + text + content[8 + length :]


def test_huge_files_pipes_and_devices_are_not_read(path: Path) -> None:
    """The file has 8 GiB, the pipe has no writer, and the device never ends."""
    with path.open("wb") as file:
        file.truncate(8 * _GIB)
    assert "more than the limit of 268435456" in _refused(path)
    path.unlink()
    os.mkfifo(path)
    assert "not a regular file" in _refused(path)
    path.unlink()
    path.symlink_to("/dev/zero")
    assert "not a regular file" in _refused(path)
