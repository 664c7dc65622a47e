"""Settings of all tests, and fixtures for rendering and for browsing."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest
from hypothesis import settings

from tests.drawing import draws, missing

if TYPE_CHECKING:
    from playwright.sync_api import Browser

# Processes started in the background, such as by `nohup`, ignore SIGINT, and so do their children,
# but some tests interrupt the processes that they start.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# One thread is fastest for small networks, in each worker and in the processes that tests start.
os.environ.setdefault("OMP_NUM_THREADS", "1")

# No test asserts a wall-clock time. Every run tries the same examples, so that results and coverage
# are reproducible.
settings.register_profile("shapechanger", deadline=None, derandomize=True)
settings.load_profile("shapechanger")


# The tests that cover the packages of the coverage gate (`tool.coverage` in pyproject.toml).
# Tracing would slow all other tests down by a third, and they add nothing to this coverage.
COVERING = tuple(
    f"tests/{path}"
    for path in (
        *(
            "test_architecture.py",
            "test_errors.py",
            "test_layout.py",
            "contract/test_drive_reward.py",
            "contract/test_limits.py",
        ),
        *("envs/stepping/", "envs/vector/", "envs/test_own_tasks.py", "laws/", "morphology/"),
        *("finger/identify/", "finger/test_paths.py", "finger/test_task.py"),
        *("robot/guard/", "robot/link/", "robot/profile/"),
        *("transfer/body_map/", "transfer/metrics/"),
    )
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark tests that are retried, and those that need no tracing.

    `realtime` tests start processes, open sockets or kill something, and a pause of the machine can
    fail a correct one. They are retried once; the summary lists each retry as `RERUN`.
    """
    for item in items:
        if item.get_closest_marker("realtime"):
            item.add_marker(pytest.mark.flaky(reruns=1))
        if not item.nodeid.startswith(COVERING) or item.get_closest_marker("system"):
            item.add_marker(pytest.mark.no_cover)


@pytest.fixture(scope="session", autouse=True)
def no_config_of_the_user(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep keys and known robots of tests and of their programs in a folder of their own."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CONFIG_HOME", str(tmp_path_factory.mktemp("config")))
        yield


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    """A headless browser, which ends with the module, as does Playwright's event loop."""
    from playwright.sync_api import sync_playwright

    path = shutil.which("chromium") or shutil.which("google-chrome")
    if path is None:
        missing("There is no Chromium")
    with sync_playwright() as playwright:
        arguments = ["--no-sandbox", "--disable-gpu"]
        browser = playwright.chromium.launch(executable_path=path, args=arguments)
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def gl() -> None:
    """Skip without an OpenGL library."""
    if not any(draws(library) for library in ("egl", "osmesa", "glfw")):
        missing("Neither EGL nor OSMesa nor a display works here")


@pytest.fixture(scope="session")
def egl() -> None:
    """Skip without EGL and its driver."""
    if not draws("egl"):
        missing("EGL does not work here")


@pytest.fixture(scope="session")
def osmesa() -> None:
    """Skip without OSMesa, which renders on the CPU."""
    if not draws("osmesa"):
        missing("OSMesa does not work here")


@pytest.fixture(scope="session")
def display() -> Iterator[str]:
    """Yield the name of a virtual display."""
    server = shutil.which("Xvfb")
    if server is None:
        missing("There is no Xvfb")
    read_end, write_end = os.pipe()
    # The server picks a free number and prints it when it is ready.
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
