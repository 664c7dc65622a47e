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


# Robots are processes that keep time with one another. Where the machine stands still for half a
# second, what is right fails too; the summary names what had to be tried again.
_IN_REAL_TIME = ("robot", "remote", "twin", "cli/robot", "cli/demos/test_on_robot.py")
_REAL_TIME_CLAIMS = "claims/test_robot_"
_AGAIN = 2


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Try the tests of running robots again when they fail."""
    for item in items:
        path = item.path.relative_to(config.rootpath / "tests")
        if path.as_posix().startswith(_REAL_TIME_CLAIMS) or any(
            path.is_relative_to(folder) for folder in _IN_REAL_TIME
        ):
            item.add_marker(pytest.mark.flaky(reruns=_AGAIN))


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
