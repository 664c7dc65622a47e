"""Lines, free names and appended bytes of an episode, and the rate of its steps."""

import binascii
import errno
import io
import math
import os
import re
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shapechanger.demos.episodes import EpisodeMark
from shapechanger.demos.episodes.records import (
    append,
    encode_line,
    free_path,
    is_same_rate,
    parse_line,
    rate_jitter,
)
from shapechanger.errors import OutputError
from tests.demos.episodes.making import step


@settings(max_examples=60)
@given(
    stem=st.sampled_from(["x", "x-2-foo", "x-0007", "x-²", "x-٣٤٥٦", "-0001", "a\nb"])
    | st.text("x-019 ", min_size=1, max_size=9),
    kinds=st.lists(
        st.sampled_from([Path.mkdir, Path.touch, lambda path: path.symlink_to("nowhere")]),
        max_size=5,
    ),
)
def test_a_free_path_is_found_beside_any_others(
    stem: str, kinds: list[Callable[[Path], None]], tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("recording")
    for make in kinds:
        path = free_path(folder, stem, ".part")
        assert not os.path.lexists(path)
        assert path.name.startswith(re.sub("-[0-9]{4}$", "", stem))
        make(path)
    assert len(list(folder.iterdir())) == len(kinds)


def test_free_names_count_up_to_a_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shapechanger.demos.episodes.records._MOST_OF_A_NAME", 2)
    for stem, taken in (
        ("x", ["x", "x-0001", "x-0002"]),
        ("a\nb-0001", ["a\nb-0001", "a\nb-0002"]),
    ):
        for name in taken:
            assert free_path(tmp_path, stem).name == name
            (tmp_path / name).touch()
    with pytest.raises(OutputError, match=f"{tmp_path} has too many files with names like x"):
        free_path(tmp_path, "x")
    assert free_path(tmp_path, "x-0002").name == "x-0002-0001"


@pytest.mark.parametrize("fails", [False, True])
def test_bytes_are_appended_completely_or_not_at_all(tmp_path: Path, fails: bool) -> None:
    class Slow(io.FileIO):
        def write(self, data: Any) -> int:
            if fails and os.fstat(self.fileno()).st_size > 5:
                raise OSError(errno.ENOSPC, "No space left on device")
            return super().write(data[:3])

    (tmp_path / "file").write_bytes(b"old")
    with Slow(tmp_path / "file", "a+") as file, suppress(OSError):
        append(file, b"0123456789")
    assert (tmp_path / "file").read_bytes() == (b"old" if fails else b"old0123456789")


def _line(body: bytes) -> bytes:
    return body[:-1] + b',"crc":"%08x"}\n' % binascii.crc32(body[:-1])


def test_lines_are_short_utf8_with_a_checksum() -> None:
    mark = EpisodeMark(1, "é")
    assert encode_line(mark) == _line('{"kind":"mark","step":1,"text":"é"}'.encode())
    assert parse_line(encode_line(EpisodeMark(1, "\ud800"))) == EpisodeMark(1, "?")
    assert parse_line(_line(b'{"kind":"new"}')) is None
    with pytest.raises(ValueError, match="JSON compliant"):
        encode_line({"number": math.nan})
    one = step(action=(np.float32(0.5), np.int64(1)), state=(math.nan, math.inf)).to_json()
    assert (one["action"], one["state"]) == ([0.5, 1.0], [None, "inf"])


def test_an_invalid_line_is_refused() -> None:
    longest = encode_line(EpisodeMark(0, "x" * ((1 << 20) - len(encode_line(EpisodeMark(0, ""))))))
    assert len(longest) == 1 << 20
    assert isinstance(parse_line(longest), EpisodeMark)
    for line, reason in (
        (longest + b"x", "it has 1048577 bytes"),
        (b"", "it is cut off or was changed"),
        (_line(b'{"kind":"mark"}'), "it is invalid .*step"),
        (_line(b'{"x":' + b"[" * 100_000 + b"}"), "it is nested too deeply"),
    ):
        with pytest.raises(ValueError, match=f"^{reason}"):
            parse_line(line)


def test_jitter_is_measured_and_bounded() -> None:
    assert rate_jitter([0.05] * 20, 20.0) == pytest.approx(0.0)
    assert rate_jitter([0.051] * 97 + [5.0] * 3, 20.0) == pytest.approx(0.02)
    for end in (0.04, 0.06):
        assert rate_jitter(np.linspace(0.05, end, 101).tolist(), 20.0) == pytest.approx(0.19)
    assert rate_jitter([0.05, 0.2] * 10, 20.0) == 0.25
    assert rate_jitter([0.2] * 19, 20.0) == 0.0
    assert is_same_rate(19.61, 20.0, 0.02)
    assert not is_same_rate(19.61, 20.0)
    assert is_same_rate(25.0, 20.0, 9.9)
    assert not is_same_rate(10.0, 20.0, 9.9)
