"""Choosing what draws where there is no screen, each time in an interpreter of its own."""

from __future__ import annotations

import sys

import pytest

from tests.drawing import run_python

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="Elsewhere there is always a screen."
)

_CHOOSE = """
import os
from shapechanger.rendering import choose_gl
choose_gl()
print(os.environ.get("MUJOCO_GL"))
"""
# What is installed is what can be found.
_INSTALLED = """
import ctypes.util
ctypes.util.find_library = lambda name: {libraries!r}.get(name, None)
"""
# A library of EGL that knows so many devices, of which each has a driver or not.
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
    """EGL with so many devices, of which those of these numbers, from 1, have a driver."""
    displays = tuple(10 + driver for driver in drivers)
    return _EGL.format(devices=devices, drivers=displays, extensions=extensions)


_NO_DRIVER = _egl(devices=2)


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
    """A container may have the library but no device, and a machine a device without driver."""
    installed = _installed(EGL="libEGL.so.1", OSMesa="libOSMesa.so.8")
    assert _says(installed + egl + _CHOOSE) == chosen


@pytest.mark.parametrize("broken", ["", _NO_DRIVER], ids=["nothing", "EGL without a driver"])
def test_a_sentence_says_what_to_install(broken: str) -> None:
    """Where neither works, one command helps."""
    libraries = {"EGL": "libEGL.so.1"} if broken else {}
    run = run_python(_installed(**libraries) + broken + _CHOOSE)
    assert run.returncode == 1
    assert run.stderr.splitlines()[-1] == (
        "shapechanger.errors.RenderError: There is no screen, and neither EGL nor OSMesa works: "
        "on Debian or Ubuntu run `apt-get install libegl1 libgl1-mesa-dri`, or "
        "libosmesa6."
    )


@pytest.mark.parametrize("choice", ["egl", "osmesa", "glfw"])
def test_the_choice_of_the_user_stands(choice: str) -> None:
    """Whoever sets `MUJOCO_GL` knows better."""
    assert _says(_installed() + _CHOOSE, MUJOCO_GL=choice) == choice


@pytest.mark.parametrize("choice", ["whatever", "disable", "EGL"])
def test_a_choice_that_does_not_draw_is_refused(choice: str) -> None:
    """The sentence names those that do."""
    run = run_python(_CHOOSE, MUJOCO_GL=choice)
    assert run.stderr.splitlines()[-1] == (
        f"shapechanger.errors.RenderError: With MUJOCO_GL={choice} nothing can be drawn: set it to "
        "one of egl, osmesa, glfw, or unset it."
    )


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


def test_a_display_that_does_not_open_is_refused_in_a_sentence() -> None:
    """GLFW would end the process at the first window, and MuJoCo speak of its platform library."""
    window, picture = (
        _says(_MAKE.format(asks="") + _REFUSED.format(statement=statement), DISPLAY=":77")
        for statement in (
            "gym.make('shapechanger/Ant-v1', render_mode='human')",
            "gym.make('shapechanger/Ant-v1').unwrapped.picture()",
        )
    )
    assert window == picture
    assert window.startswith("GLFW opens no window on the display :77")


@pytest.mark.parametrize(("width", "height"), [(-5, 48), (64, 0), (100_000_000, 48)])
def test_a_picture_of_no_size_is_refused(width: int, height: int) -> None:
    """Before anything is made that large."""
    statement = f"gym.make('shapechanger/Ant-v1').unwrapped.picture({width}, {height})"
    assert _says(_MAKE.format(asks="") + _REFUSED.format(statement=statement)) == (
        f"An image must be 1 to 8192 pixels wide and high, got {width} x {height}."
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
