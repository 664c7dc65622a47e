"""What holds for all tests, and what those that draw ask for."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
from collections.abc import Iterator

import pytest
from hypothesis import settings

from tests.drawing import draws, missing

# What `nohup` or a script starts in the background ignores Ctrl-C, and so would all that the tests
# start, some of which is there to be interrupted.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# No test asserts a wall-clock time: a busy machine is no defect. Every run tries the same examples,
# so that what passes here, and what is covered here, does everywhere.
settings.register_profile("shapechanger", deadline=None, derandomize=True)
settings.load_profile("shapechanger")


@pytest.fixture(scope="session")
def gl() -> None:
    """Something to draw with."""
    if not any(draws(library) for library in ("egl", "osmesa", "glfw")):
        missing("Neither EGL nor OSMesa nor a display works here")


@pytest.fixture(scope="session")
def egl() -> None:
    """EGL, and a driver for it."""
    if not draws("egl"):
        missing("EGL does not work here")


@pytest.fixture(scope="session")
def osmesa() -> None:
    """OSMesa, which draws on the processor."""
    if not draws("osmesa"):
        missing("OSMesa does not work here")


@pytest.fixture(scope="session")
def display() -> Iterator[str]:
    """The name of a display that nobody looks at."""
    server = shutil.which("Xvfb")
    if server is None:
        missing("There is no Xvfb")
    read_end, write_end = os.pipe()
    # The server picks a free number, and writes it when it is ready.
    command = [server, "-displayfd", str(write_end), "-screen", "0", "640x480x24"]
    command += ["-nolisten", "tcp"]
    with subprocess.Popen(command, pass_fds=[write_end], stderr=subprocess.DEVNULL) as process:
        os.close(write_end)
        try:
            with os.fdopen(read_end) as numbers:
                number = numbers.readline().strip()
            if not number:
                missing("Xvfb does not start here")
            yield f":{number}"
        finally:
            process.terminate()
