"""What holds for all tests."""

from __future__ import annotations

import pytest
from hypothesis import settings

from tests.envs.drawing import draws, missing

# No test asserts a wall-clock time: a busy machine is no defect.
settings.register_profile("shapechanger", deadline=None)
settings.load_profile("shapechanger")


@pytest.fixture(scope="session")
def gl() -> None:
    """Something to draw with."""
    if not any(draws(library) for library in ("egl", "osmesa", "glfw")):
        missing("Neither EGL nor OSMesa nor a display works here")
