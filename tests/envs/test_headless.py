"""Choosing what draws where there is no screen, each time in an interpreter of its own."""

from __future__ import annotations

import sys

import pytest

from tests.envs.drawing import run_python

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="Elsewhere there is always a screen."
)

_CHOOSE = """
import os
from shapechanger.envs.headless import choose_gl
choose_gl()
print(os.environ.get("MUJOCO_GL"))
"""
# What is installed is what can be found.
_INSTALLED = """
import ctypes.util
found = ctypes.util.find_library
ctypes.util.find_library = lambda name: {libraries!r}.get(name, None)
"""
# A library without a driver: it opens, and knows no device.
_NO_DEVICE = """
import ctypes

class Function:
    def __call__(self, *arguments):
        return 0

class Library:
    eglGetProcAddress = Function()
    eglInitialize = Function()

ctypes.CDLL = lambda name, *arguments, **more: Library()
"""


def _installed(**libraries: str) -> str:
    return _INSTALLED.format(libraries=libraries)


def _says(script: str, **variables: str) -> str:
    run = run_python(script, **variables)
    assert run.returncode == 0, run.stderr
    return run.stdout.strip()


@pytest.mark.gl
@pytest.mark.usefixtures("egl")
def test_egl_is_chosen() -> None:
    """It draws on the graphics card, or on the processor where there is none."""
    assert _says(_CHOOSE) == "egl"


def test_osmesa_is_chosen_where_egl_is_missing() -> None:
    """It draws on the processor."""
    assert _says(_installed(OSMesa="libOSMesa.so.8") + _CHOOSE) == "osmesa"


def test_osmesa_is_chosen_where_egl_has_no_driver() -> None:
    """As in a container that has the library but no device."""
    installed = _installed(EGL="libEGL.so.1", OSMesa="libOSMesa.so.8")
    assert _says(installed + _NO_DEVICE + _CHOOSE) == "osmesa"


@pytest.mark.parametrize("broken", ["", _NO_DEVICE], ids=["nothing", "EGL without a driver"])
def test_a_sentence_says_what_to_install(broken: str) -> None:
    """Where neither works, one command helps."""
    libraries = {"EGL": "libEGL.so.1"} if broken else {}
    run = run_python(_installed(**libraries) + broken + _CHOOSE)
    assert run.returncode == 1
    assert run.stderr.splitlines()[-1] == (
        "shapechanger.errors.RenderError: There is no screen, and neither EGL nor OSMesa to draw "
        "without one: on Debian or Ubuntu run `apt-get install libegl1 libgl1-mesa-dri`, or "
        "libosmesa6."
    )


@pytest.mark.parametrize("choice", ["egl", "osmesa", "glfw", "whatever"])
def test_the_choice_of_the_user_stands(choice: str) -> None:
    """Whoever sets `MUJOCO_GL` knows better."""
    assert _says(_installed() + _CHOOSE, MUJOCO_GL=choice) == choice


@pytest.mark.parametrize("name", ["DISPLAY", "WAYLAND_DISPLAY"])
def test_nothing_is_chosen_where_there_is_a_screen(name: str) -> None:
    """MuJoCo then draws with GLFW, or finds something itself."""
    assert _says(_installed() + _CHOOSE, **{name: ":0"}) == "None"
    assert _says(_installed(OSMesa="libOSMesa.so.8") + _CHOOSE, **{name: ""}) == "osmesa"


_MAKE = """
import gymnasium as gym
import shapechanger

{asks}
"""
_REFUSED = """
from shapechanger.errors import RenderError
try:
    {statement}
except RenderError as error:
    print(error)
"""


def test_an_env_that_cannot_draw_is_refused_when_it_is_made() -> None:
    """Not at the first frame, an hour into a training; without pictures it can be made."""
    script = (
        _installed()
        + _MAKE.format(asks="gym.make('shapechanger/Ant-v1').reset(seed=0)")
        + _REFUSED.format(statement="gym.make('shapechanger/Ant-v1', render_mode='rgb_array')")
        + _REFUSED.format(statement="gym.make('shapechanger/Ant-v1').unwrapped.picture()")
    )
    made, drawn = _says(script).splitlines()
    assert made == drawn
    assert made.startswith("There is no screen, and neither EGL nor OSMesa")


def test_a_window_without_a_screen_is_refused_in_a_sentence() -> None:
    """GLFW would end the process."""
    script = _MAKE.format(asks="") + _REFUSED.format(
        statement="gym.make('shapechanger/Ant-v1', render_mode='human')"
    )
    for variables in ({}, {"MUJOCO_GL": "egl"}):
        assert _says(script, **variables) == (
            "There is no screen to open a window on: make the env with render_mode='rgb_array', "
            "or run the program under `xvfb-run`."
        )


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
    """A frame is drawn where EGL is not found, by whoever is chosen then."""
    without_egl = (
        "import ctypes.util\n"
        "found = ctypes.util.find_library\n"
        "ctypes.util.find_library = lambda name: None if name == 'EGL' else found(name)\n"
    )
    assert _says(without_egl + _DRAW).splitlines() == ["osmesa (48, 64, 3) True", "True"]


@pytest.mark.gl
@pytest.mark.usefixtures("egl")
def test_egl_draws() -> None:
    """A frame is drawn without anybody's choice."""
    assert _says(_DRAW).splitlines() == ["egl (48, 64, 3) True", "True"]
