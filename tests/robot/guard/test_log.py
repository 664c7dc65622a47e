"""The non-blocking log of guard and supervisor."""

import contextlib
import fcntl
import logging
import os
from collections.abc import Iterator
from pathlib import Path

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
    read, write = pipe
    _emit(_Lines(write), "\ud800" * 10_000)
    data = os.read(read, 1 << 16)
    assert len(data) == 4096
    assert data.startswith(b"\\ud800")
    assert data.endswith(b"\n")


class _Unprintable:
    """An argument whose text cannot be made."""

    def __init__(self, error: Exception) -> None:
        self._error = error

    def __str__(self) -> str:
        raise self._error


@pytest.mark.parametrize(
    ("words", "args", "error"),
    [
        ("%s", (_Unprintable(RuntimeError()),), "RuntimeError"),
        ("%s", (_Unprintable(MemoryError()),), "MemoryError"),
        ("%d", ("three",), "TypeError"),
        ("%s %s", ("one",), "TypeError"),
        ("%q", (1,), "ValueError"),
    ],
)
def test_a_line_that_cannot_be_formatted_is_replaced(
    pipe: tuple[int, int], words: str, args: tuple[object, ...], error: str
) -> None:
    read, write = pipe
    record = logging.LogRecord("robot", logging.INFO, "/x/rules.py", 7, words, args, None)
    _Lines(write).handle(record)
    assert os.read(read, 1 << 16) == f"A line of rules.py:7 fails: {error}.\n".encode()


@contextlib.contextmanager
def _broken(kind: str, folder: Path) -> Iterator[int]:
    """Yield a descriptor that cannot be written to."""
    read, write = os.pipe()
    match kind:
        case "no reader":
            os.close(read)
            read = os.open(os.devnull, os.O_RDONLY)
        case "closed":
            os.close(write)
            # Not reused by another file during the test.
            write = os.open(os.devnull, os.O_RDONLY)
        case "read-only":
            (folder / "log").touch()
            os.close(write)
            write = os.open(folder / "log", os.O_RDONLY)
        case _:
            os.close(write)
            write = os.open("/dev/full", os.O_WRONLY)
    try:
        yield write
    finally:
        os.close(read)
        os.close(write)


@pytest.mark.parametrize("kind", ["no reader", "closed", "read-only", "full disk"])
def test_a_log_that_cannot_be_written_raises_nothing(kind: str, tmp_path: Path) -> None:
    with _broken(kind, tmp_path) as fd:
        lines = _Lines(fd)
        for words in ("Hello.", "\ud800", "\0", "a\nb", "x" * 100_000):
            _emit(lines, words)
        assert lines._lost == 5


def test_a_descriptor_that_closes_later_raises_nothing() -> None:
    read, write = os.pipe()
    lines = _Lines(write)
    os.close(write)
    os.close(read)
    _emit(lines, "Hello.")
    assert lines._lost == 1
