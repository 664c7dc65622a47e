"""Atomic writes, and errors that name the file."""

from __future__ import annotations

from pathlib import Path

import pytest

from shapechanger.errors import CorruptStudy, OutputError
from shapechanger.files import (
    append_line,
    make_folder,
    read_json,
    write_atomic,
    write_json,
)


def test_json_round_trip(tmp_path: Path) -> None:
    """JSON round trips."""
    write_json(tmp_path / "a.json", {"x": [1, 2]})
    assert read_json(tmp_path / "a.json", dict[str, list[int]], "try") == {"x": [1, 2]}


def test_writes_are_atomic(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A write that fails keeps the old file, and leaves no other."""
    path = tmp_path / "a.json"
    write_atomic(path, b"old")

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OutputError, match=r"Cannot write .*a\.json: No space left on device"):
        write_atomic(path, b"new")
    assert path.read_bytes() == b"old"
    assert [item.name for item in tmp_path.iterdir()] == ["a.json"]


@pytest.mark.parametrize("content", [b"", b"{", b"[1]", b'{"x": "1"}', b"\xff"])
def test_an_invalid_file_is_named(tmp_path: Path, content: bytes) -> None:
    """The message has the file and the remedy."""
    path = tmp_path / "run.json"
    path.write_bytes(content)
    with pytest.raises(CorruptStudy, match=r"run\.json cannot be read .*: delete it\."):
        read_json(path, dict[str, int], "delete it")


def test_lines_are_added_and_a_folder_in_the_way_is_an_error(tmp_path: Path) -> None:
    """Each value is one line; a folder of that name is an error."""
    append_line(tmp_path / "curve", {"a": 1})
    append_line(tmp_path / "curve", {"a": 2})
    assert (tmp_path / "curve").read_text() == '{"a":1}\n{"a":2}\n'
    with pytest.raises(OutputError, match="Cannot write"):
        append_line(tmp_path, 1)


def test_folders_are_made_with_their_parents(tmp_path: Path) -> None:
    """Folders may exist already, and stay empty."""
    make_folder(tmp_path / "a" / "b")
    make_folder(tmp_path / "a" / "b")
    assert not list((tmp_path / "a" / "b").iterdir())
