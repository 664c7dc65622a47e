"""Lines of a file that grows are found where they are."""

from __future__ import annotations

import tempfile
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from shapechanger.robot.daemon.library import LineIndex

_parts = st.lists(st.sampled_from((b"a", b"bb\n", b"\n", b"c\rd\n", b"x" * 70_000)), max_size=12)


@given(parts=_parts)
def test_every_complete_line_is_found_however_the_file_grew(parts: list[bytes]) -> None:
    """As often as one looks, and only those that have ended."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "lines"
        path.touch()
        index = LineIndex(path)
        whole = b""
        for part in parts:
            whole += part
            with path.open("ab") as file:
                file.write(part)
            with path.open("rb") as file:
                index.refresh(file)
                lines = [line + b"\n" for line in whole.split(b"\n")[:-1]]
                assert [index.read(file, n) for n in range(len(index))] == lines


def test_a_file_that_was_replaced_or_cut_is_read_anew(tmp_path: Path) -> None:
    """As `repair` does both."""
    path = tmp_path / "lines"
    path.write_bytes(b"one\ntwo\nthree\n")
    index = LineIndex(path)
    for content in (b"one\ntwo\nthree\n", b"one\n", b"1\n2\n"):
        other = tmp_path / "other"
        other.write_bytes(content)
        other.replace(path)
        with path.open("rb") as file:
            index.refresh(file)
            found = b"".join(index.read(file, n) for n in range(len(index)))
        assert found == content
