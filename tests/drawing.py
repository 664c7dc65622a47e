"""Detection of OpenGL libraries, and skipping of tests without them."""

from __future__ import annotations

import functools
import os
import subprocess
import sys
from typing import Final, NoReturn

import pytest

# Environment variables that select the OpenGL library.
CHOICE: Final = ("DISPLAY", "WAYLAND_DISPLAY", "MUJOCO_GL", "PYOPENGL_PLATFORM")


def missing(reason: str) -> NoReturn:
    """Skip the test, or fail it on CI, which skips no test."""
    if os.environ.get("CI") == "true":
        pytest.fail(f"{reason}, and CI skips no test.")
    pytest.skip(reason)


@functools.cache
def draws(library: str) -> bool:
    """Return whether a context of `egl`, `osmesa` or `glfw` opens."""
    script = f"from mujoco.{library} import GLContext; GLContext(16, 16).make_current()"
    screen = {name: os.environ[name] for name in CHOICE[:2] if name in os.environ}
    return run_python(script, **screen).returncode == 0


def run_python(script: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run a script in a new interpreter without the variables of `CHOICE`."""
    kept = {name: value for name, value in os.environ.items() if name not in CHOICE}
    return subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        env=kept | variables,
        timeout=120,
    )
