"""The non-blocking log of guard and supervisor."""

import fcntl
import logging
import os
from collections.abc import Iterator

import pytest

from shapechanger.robot.guard.log import _Lines


@pytest.fixture
def pipe() -> Iterator[tuple[int, int]]:
    """A pipe that holds one page."""
    read, write = os.pipe()
    fcntl.fcntl(write, fcntl.F_SETPIPE_SZ, 4096)
    yield read, write
    os.close(write)
    os.close(read)


def _emit(lines: logging.Handler, words: str) -> None:
    lines.handle(logging.LogRecord("robot", logging.INFO, "", 0, words, None, None))


def test_a_full_pipe_drops_lines(
    pipe: tuple[int, int],
) -> None:
    """Lost lines are counted, and the flags of the shared descriptor do not change."""
    read, write = pipe
    flags = fcntl.fcntl(write, fcntl.F_GETFL)
    lines = _Lines(write)
    for _ in range(100):
        _emit(lines, "x" * 100)
    seen = os.read(read, 1 << 16)
    written = seen.count(b"\n")
    assert 0 < written < 100
    _emit(lines, "Again.")
    assert (
        os.read(read, 1 << 16) == f"Again. ({100 - written} lines before it were lost.)\n".encode()
    )
    assert fcntl.fcntl(write, fcntl.F_GETFL) == flags


def test_a_line_is_cut_to_the_size_of_a_pipe(pipe: tuple[int, int]) -> None:
    """Longer lines would block; characters that cannot be encoded are escaped."""
    read, write = pipe
    _emit(_Lines(write), "\ud800" * 10_000)
    data = os.read(read, 1 << 16)
    assert len(data) == 4096
    assert data.startswith(b"\\ud800")
    assert data.endswith(b"\n")


def test_a_log_without_a_reader_raises_nothing() -> None:
    """Writing to a pipe whose reader is closed is ignored."""
    read, write = os.pipe()
    os.close(read)
    try:
        _emit(_Lines(write), "Hello.")
    finally:
        os.close(write)
