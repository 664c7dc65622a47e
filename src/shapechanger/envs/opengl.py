"""Choose the OpenGL library with which MuJoCo draws, and check that it works."""

from __future__ import annotations

import ctypes.util
import os
import sys
import warnings
from functools import cache
from importlib import import_module
from typing import Any, Final

from shapechanger.errors import RenderError

_LIBRARIES: Final = ("egl", "osmesa", "glfw")
# Other values of MUJOCO_GL, for GLFW or for no drawing; MuJoCo cannot be imported with any other.
_OTHER_VALUES: Final = (
    *("", "enable", "enabled", "on", "true", "1", "glx", "wgl", "cgl"),
    *("disable", "disabled", "off", "false", "0"),
)

_PROBE: Final = 16  # Width and height of an invisible test window, pixels.


def has_screen() -> bool:
    """Return whether a window can be opened: on Linux only with a display, elsewhere always."""
    return sys.platform != "linux" or any(
        os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")
    )


def require_screen() -> None:
    """Raise a RenderError unless a window opens; GLFW would end the process otherwise."""
    if not has_screen():
        raise RenderError(
            "There is no screen to open a window on: make the env with render_mode='rgb_array', "
            "or run the program under `xvfb-run`."
        )
    _require_glfw()


def choose_gl() -> None:
    """Set `MUJOCO_GL` to EGL or OSMesa if it is not set and there is no screen."""
    chosen = os.environ.get("MUJOCO_GL", "")
    _require_in(("", *_LIBRARIES), chosen)
    if chosen or has_screen():
        return
    installed = {"egl": "EGL", "osmesa": "OSMesa"}
    found = [name for name in installed if ctypes.util.find_library(installed[name])]
    if not found:
        raise RenderError(
            "There is no screen, and neither EGL nor OSMesa is installed: on Debian or "
            "Ubuntu run `apt-get install libegl1 libgl1-mesa-dri`, or libosmesa6."
        )
    os.environ["MUJOCO_GL"] = found[0]


def require_known_gl() -> None:
    """Raise a RenderError unless MuJoCo can be imported with the value of `MUJOCO_GL`."""
    _require_in((*_LIBRARIES, *_OTHER_VALUES), os.environ.get("MUJOCO_GL", "").lower().strip())


def _require_in(values: tuple[str, ...], chosen: str) -> None:
    if chosen not in values:
        raise RenderError(
            f"MuJoCo cannot render with MUJOCO_GL={chosen}: set it to one of "
            f"{', '.join(_LIBRARIES)}, or unset it."
        )


def open_context(width: int, height: int) -> Any:
    """Open a context for drawing without a window, of a size in pixels, and make it current.

    `mujoco.GLContext` uses the value that `MUJOCO_GL` had when MuJoCo was imported; this function
    uses the present value.
    """
    library = os.environ.get("MUJOCO_GL") or "glfw"
    if library == "glfw":
        _require_glfw()
    try:
        context: Any = import_module(f"mujoco.{library}").GLContext(width, height)
        context.make_current()
    except Exception as error:  # Raised by PyOpenGL, ctypes or MuJoCo.
        raise RenderError(
            f"MUJOCO_GL={library} does not work here ({_first_line(error)}): set it to one of "
            f"{', '.join(_LIBRARIES)}, or unset it."
        ) from error
    return context


@cache
def _require_glfw() -> None:
    """Raise a RenderError unless GLFW opens a window; a check that succeeds is not repeated."""
    display = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    where, window = f" on the display {display}" if display else "", None
    try:
        glfw: Any = import_module("glfw")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # The error below is enough.
            if glfw.init() and glfw.get_primary_monitor():
                glfw.window_hint(glfw.VISIBLE, False)
                window = glfw.create_window(_PROBE, _PROBE, "", None, None)
                glfw.default_window_hints()
        if window:
            glfw.destroy_window(window)
    except ImportError as error:  # GLFW's library is missing.
        where = f" ({_first_line(error)})"
    if not window:
        raise RenderError(
            f"GLFW opens no window{where}: set DISPLAY to an existing display, or unset it and "
            "MUJOCO_GL to draw without a screen."
        )


def _first_line(error: Exception) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0].rstrip(".")
