"""Selection of the OpenGL library, each in a new interpreter."""

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
# Fake EGL library with devices, with and without drivers.
_EGL = """
import ctypes

pointer, count = ctypes.c_void_p, ctypes.POINTER(ctypes.c_int)

@ctypes.CFUNCTYPE(ctypes.c_uint, ctypes.c_int, ctypes.POINTER(pointer), count)
def devices(most, found, number):
    for i in range({devices}):
        found[i] = 1 + i
    number[0] = {devices}
    return 1

@ctypes.CFUNCTYPE(pointer, ctypes.c_uint, pointer, pointer)
def display(platform, device, nothing):
    return 10 + device

extensions = {{b"eglQueryDevicesEXT": devices, b"eglGetPlatformDisplayEXT": display}}

class Function:
    def __init__(self, call):
        self.call = call

    def __call__(self, *arguments):
        return self.call(*arguments)

class Library:
    eglGetProcAddress = Function(
        lambda name: ctypes.cast(extensions[name], pointer).value if {extensions} else None
    )
    eglInitialize = Function(lambda display, major, minor: display in {drivers})

ctypes.CDLL = lambda name, *arguments, **more: Library()
"""


def _egl(*, devices: int = 0, drivers: tuple[int, ...] = (), extensions: bool = True) -> str:
    """Return a fake EGL; `drivers` are the numbers, from 1, of the devices with a driver."""
    displays = tuple(10 + driver for driver in drivers)
    return _EGL.format(devices=devices, drivers=displays, extensions=extensions)


_NO_DRIVER = _egl(devices=2)


def _installed(**libraries: str) -> str:
    return _INSTALLED.format(libraries=libraries)


def _output(script: str, **variables: str) -> str:
    run = run_python(script, **variables)
    assert run.returncode == 0, run.stderr
    return run.stdout.strip()


@pytest.mark.parametrize(
    ("egl", "chosen"),
    [
        (_egl(extensions=False), "osmesa"),
        (_egl(), "osmesa"),
        (_NO_DRIVER, "osmesa"),
        (_egl(devices=2, drivers=(2,)), "egl"),
    ],
    ids=["no extensions", "no device", "no driver", "a driver for the second device"],
)
def test_egl_is_chosen_where_a_device_opens(egl: str, chosen: str) -> None:
    installed = _installed(EGL="libEGL.so.1", OSMesa="libOSMesa.so.8")
    assert _output(installed + egl + _CHOOSE) == chosen


def test_missing_libraries_are_reported() -> None:
    """Without EGL and OSMesa, the error has the command that installs them."""
    run = run_python(_installed(EGL="libEGL.so.1") + _NO_DRIVER + _CHOOSE)
    assert run.returncode == 1
    assert run.stderr.splitlines()[-1] == (
        "shapechanger.errors.RenderError: There is no screen, and neither EGL nor OSMesa works: "
        "on Debian or Ubuntu run `apt-get install libegl1 libgl1-mesa-dri`, or "
        "libosmesa6."
    )


@pytest.mark.parametrize("choice", ["egl", "osmesa", "glfw"])
def test_mujoco_gl_takes_precedence(choice: str) -> None:
    """Other values are refused with those that exist."""
    assert _output(_installed() + _CHOOSE, MUJOCO_GL=choice) == choice
    run = run_python(_CHOOSE, MUJOCO_GL=choice.upper())
    assert run.stderr.splitlines()[-1] == (
        f"shapechanger.errors.RenderError: MuJoCo cannot render with MUJOCO_GL={choice.upper()}: "
        "set it to one of egl, osmesa, glfw, or unset it."
    )


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
    """`gym.make` with a render mode raises at once; without rendering it works."""
    script = (
        _installed()
        + _MAKE.format(asks="gym.make('shapechanger/Ant-v1').reset(seed=0)")
        + _REFUSED.format(statement="gym.make('shapechanger/Ant-v1', render_mode='rgb_array')")
        + _REFUSED.format(statement="gym.make('shapechanger/Ant-v1').unwrapped.picture()")
    )
    made, drawn = _output(script).splitlines()
    assert made == drawn
    assert made.startswith("There is no screen, and neither EGL nor OSMesa")


def test_a_window_without_a_display_is_refused() -> None:
    """`render_mode="human"` without a display raises; GLFW would abort the process."""
    script = _MAKE.format(asks="") + _REFUSED.format(
        statement="gym.make('shapechanger/Ant-v1', render_mode='human')"
    )
    for variables in ({}, {"MUJOCO_GL": "egl"}):
        assert _output(script, **variables).startswith("There is no screen to open a window on:")


def test_a_display_that_does_not_open_is_refused() -> None:
    """A broken `DISPLAY` raises; GLFW would abort the process."""
    window, picture = (
        _output(_MAKE.format(asks="") + _REFUSED.format(statement=statement), DISPLAY=":77")
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
    """A frame is rendered with OSMesa when EGL is missing."""
    without_egl = (
        "import ctypes.util\n"
        "found = ctypes.util.find_library\n"
        "ctypes.util.find_library = lambda name: None if name == 'EGL' else found(name)\n"
    )
    assert _output(without_egl + _DRAW).splitlines() == ["osmesa (48, 64, 3) True", "True"]


@pytest.mark.gl
@pytest.mark.usefixtures("egl")
def test_egl_draws() -> None:
    """A frame is rendered with EGL by default."""
    assert _output(_DRAW).splitlines() == ["egl (48, 64, 3) True", "True"]
