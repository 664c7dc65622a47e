"""Selection of the OpenGL library; each script runs in a new interpreter."""

from __future__ import annotations

import sys

import pytest

from tests.drawing import run_python

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="other systems always have a screen"
)

_CHOOSE = """
import os
from shapechanger.envs.opengl import choose_gl
choose_gl()
print(os.environ.get("MUJOCO_GL"))
"""
# Fake the installed libraries.
_INSTALLED = """
import ctypes.util
ctypes.util.find_library = lambda name: {libraries!r}.get(name, None)
"""


def _installed(**libraries: str) -> str:
    return _INSTALLED.format(libraries=libraries)


def _output(script: str, **variables: str) -> str:
    run = run_python(script, **variables)
    assert run.returncode == 0, run.stderr
    return run.stdout.strip()


@pytest.mark.parametrize(
    ("libraries", "chosen"),
    [
        ({"EGL": "libEGL.so.1", "OSMesa": "libOSMesa.so.8"}, "egl"),
        ({"OSMesa": "libOSMesa.so.8"}, "osmesa"),
    ],
)
def test_an_installed_library_is_chosen(libraries: dict[str, str], chosen: str) -> None:
    """EGL comes first."""
    assert _output(_installed(**libraries) + _CHOOSE) == chosen


@pytest.mark.parametrize("choice", ["egl", "osmesa", "glfw"])
def test_mujoco_gl_takes_precedence(choice: str) -> None:
    """Values that do not exist are refused, and the message lists the valid ones."""
    assert _output(_installed() + _CHOOSE, MUJOCO_GL=choice) == choice
    run = run_python(_CHOOSE, MUJOCO_GL=choice.upper())
    assert run.stderr.splitlines()[-1] == (
        f"shapechanger.errors.RenderError: MuJoCo cannot render with MUJOCO_GL={choice.upper()}: "
        "set it to one of egl, osmesa, glfw, or unset it."
    )


_MAKE = """
import gymnasium as gym
import shapechanger

{statement}
"""
_REFUSED = """
from shapechanger.errors import RenderError
try:
    {statement}
except RenderError as error:
    print(error)
"""


def test_an_env_that_cannot_draw_is_refused_when_it_is_made() -> None:
    """`gym.make` with a render mode raises at once; without rendering it works."""
    script = (
        _installed()
        + _MAKE.format(statement="gym.make('shapechanger/Ant-v1').reset(seed=0)")
        + _REFUSED.format(statement="gym.make('shapechanger/Ant-v1', render_mode='rgb_array')")
        + _REFUSED.format(statement="gym.make('shapechanger/Ant-v1').unwrapped.picture()")
    )
    made, drawn = _output(script).splitlines()
    assert made == drawn
    assert made.startswith("There is no screen, and neither EGL nor OSMesa")


def test_a_window_without_a_display_is_refused() -> None:
    """`render_mode="human"` without a display raises; GLFW would abort the process."""
    script = _MAKE.format(statement="") + _REFUSED.format(
        statement="gym.make('shapechanger/Ant-v1', render_mode='human')"
    )
    for variables in ({}, {"MUJOCO_GL": "egl"}):
        assert _output(script, **variables).startswith("There is no screen to open a window on:")


def test_a_display_that_does_not_open_is_refused() -> None:
    """A broken `DISPLAY` raises; GLFW would abort the process."""
    window, picture = (
        _output(_MAKE.format(statement="") + _REFUSED.format(statement=statement), DISPLAY=":77")
        for statement in (
            "gym.make('shapechanger/Ant-v1', render_mode='human')",
            "gym.make('shapechanger/Ant-v1').unwrapped.picture()",
        )
    )
    assert window == picture
    assert window.startswith("GLFW opens no window on the display :77")


_DRAW = """
import os
import gymnasium as gym
import shapechanger

with gym.make("shapechanger/Ant-v1", render_mode="rgb_array", width=64, height=48) as env:
    env.reset(seed=0)
    picture = env.render()
    print(os.environ["MUJOCO_GL"], picture.shape, len(set(picture.reshape(-1).tolist())) > 50)
    print(env.unwrapped.picture(64, 48).std() > 10.0)
"""


@pytest.mark.gl
@pytest.mark.usefixtures("osmesa")
def test_osmesa_draws() -> None:
    without_egl = (
        "import ctypes.util\n"
        "found = ctypes.util.find_library\n"
        "ctypes.util.find_library = lambda name: None if name == 'EGL' else found(name)\n"
    )
    assert _output(without_egl + _DRAW).splitlines() == ["osmesa (48, 64, 3) True", "True"]


@pytest.mark.gl
@pytest.mark.usefixtures("egl")
def test_egl_draws() -> None:
    assert _output(_DRAW).splitlines() == ["egl (48, 64, 3) True", "True"]
