"""The log of guard and supervisor, which never waits."""

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


def _say(lines: logging.Handler, words: str) -> None:
    lines.handle(logging.LogRecord("robot", logging.INFO, "", 0, words, None, None))


def test_a_pipe_that_nobody_reads_loses_lines_and_holds_up_nothing(
    pipe: tuple[int, int],
) -> None:
    """They are counted, and the descriptor, which is shared, stays as it was."""
    read, write = pipe
    flags = fcntl.fcntl(write, fcntl.F_GETFL)
    lines = _Lines(write)
    for _ in range(100):
        _say(lines, "x" * 100)
    seen = os.read(read, 1 << 16)
    written = seen.count(b"\n")
    assert 0 < written < 100
    _say(lines, "Again.")
    assert (
        os.read(read, 1 << 16) == f"Again. ({100 - written} lines before it were lost.)\n".encode()
    )
    assert fcntl.fcntl(write, fcntl.F_GETFL) == flags


def test_a_line_is_never_longer_than_a_pipe_takes_at_once(pipe: tuple[int, int]) -> None:
    """A longer one would wait for a reader; what has no bytes is written otherwise."""
    read, write = pipe
    _say(_Lines(write), "\ud800" * 10_000)
    data = os.read(read, 1 << 16)
    assert len(data) == 4096
    assert data.startswith(b"\\ud800")
    assert data.endswith(b"\n")


def test_a_log_without_anybody_at_the_other_end_is_no_error() -> None:
    """The robot goes on."""
    read, write = os.pipe()
    os.close(read)
    try:
        _say(_Lines(write), "Hello.")
    finally:
        os.close(write)
