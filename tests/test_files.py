"""Atomic writes, and errors that name the file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest

from shapechanger.envs.suite_file import load_suite
from shapechanger.errors import CorruptStudy, OutputError, ShapechangerError
from shapechanger.files import append_line, read_json, write_atomic, write_json
from shapechanger.finger.paths import from_csv
from shapechanger.layout import Feature, Layout
from shapechanger.morphology import Remove, from_json, to_json
from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.transfer.body_map import BodyMap
from shapechanger.transfer.learners.presets import resolve_learner

_Z = Layout((Feature("z", "m"), Feature("Größe", "m")))


def _suite(path: Path) -> Any:
    return msgspec.to_builtins(load_suite(str(path)))


_READERS: dict[str, tuple[str, Callable[[Path], Any]]] = {
    "suite.toml": (
        'pairs = [["Ant", "BigAnt"]]\nlearner = "sac"\nsteps = 1000  # größer\n',
        _suite,
    ),
    "learner.toml": (
        'preset = "sac"  # größer\n',
        lambda path: msgspec.to_builtins(resolve_learner(str(path), {})[1]),
    ),
    "profile.toml": (
        find_profile("lab-car").read_text(encoding="utf-8") + "# größer\n",
        lambda path: load_profile(path).guard_plan(),
    ),
    "path.csv": (
        "t,x,y,z\n" + "".join(f"{n / 10},{0.05 + n / 1000},0.0,0.02\n" for n in range(9)),
        lambda path: from_csv(path).duration_s,
    ),
}


@pytest.mark.parametrize("name", _READERS)
@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-be", "latin-1"])
@pytest.mark.parametrize("line_end", ["\n", "\r\n"])
def test_other_encodings_are_read_or_refused(
    tmp_path: Path, name: str, encoding: str, line_end: str
) -> None:
    """A byte-order mark has no effect, and text in other encodings is refused, never misread."""
    text, read = _READERS[name]
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    expected = read(path)
    text = text.replace("\n", line_end)
    data = text.encode(encoding, errors="replace")
    if encoding == "utf-16-be":
        data = b"\xfe\xff" + data
    path.write_bytes(data)
    if encoding == "utf-8-sig" or data == text.encode():
        assert read(path) == expected
    else:
        with pytest.raises(ShapechangerError, match="UTF-8"):
            read(path)


def test_texts_may_begin_with_a_byte_order_mark() -> None:
    """Maps and bodies are given as text, which may contain the mark of a file."""
    layouts = _Z, _Z, _Z, _Z
    text = '[observation]\n"Größe" = "zero"\n'
    assert BodyMap.from_toml(f"\ufeff{text}", *layouts) == BodyMap.from_toml(text, *layouts)
    body = to_json([Remove("bein")])
    assert from_json(f"\ufeff{body}") == from_json(body)


def test_writes_are_atomic(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A failed write keeps the old file, and leaves no partial file."""
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
    path = tmp_path / "run.json"
    write_json(path, {"x": 1})
    assert read_json(path, dict[str, int], "delete it") == {"x": 1}
    path.write_bytes(content)
    with pytest.raises(CorruptStudy, match=r"run\.json cannot be read .*: delete it\."):
        read_json(path, dict[str, int], "delete it")


def test_each_value_is_appended_as_a_line(tmp_path: Path) -> None:
    append_line(tmp_path / "curve", {"a": 1})
    append_line(tmp_path / "curve", {"a": 2})
    assert (tmp_path / "curve").read_text() == '{"a":1}\n{"a":2}\n'
    with pytest.raises(OutputError, match="Cannot write"):
        append_line(tmp_path, 1)
