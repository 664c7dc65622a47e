"""What the tests that draw ask for."""

from __future__ import annotations

import pytest

from tests.envs.drawing import draws, missing


@pytest.fixture(scope="session")
def gl() -> None:
    """Something to draw with."""
    if not any(draws(library) for library in ("egl", "osmesa", "glfw")):
        missing("Neither EGL nor OSMesa nor a display works here")
