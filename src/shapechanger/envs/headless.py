"""Choosing how MuJoCo draws where there is no screen."""

from __future__ import annotations

import ctypes
import ctypes.util
import os
import sys
from typing import Final

from shapechanger.errors import RenderError

__all__ = ["choose_gl", "has_screen", "require_screen"]

# From the Khronos registry: EGL_EXT_platform_device.
_EGL_PLATFORM_DEVICE_EXT: Final = 0x313F
_MOST_DEVICES: Final = 16


def has_screen() -> bool:
    """Whether a window can be opened: always on macOS and Windows, with a display on Linux."""
    return sys.platform != "linux" or any(
        os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")
    )


def require_screen() -> None:
    """Refuse to open a window where there is no screen; GLFW would end the process.

    Raises:
        RenderError: If there is none.
    """
    if not has_screen():
        raise RenderError(
            "There is no screen to open a window on: make the env with render_mode='rgb_array', "
            "or run the program under `xvfb-run`."
        )


def choose_gl() -> None:
    """Set `MUJOCO_GL` to EGL or OSMesa where there is no screen and nobody has set it.

    Raises:
        RenderError: If neither works.
    """
    if os.environ.get("MUJOCO_GL") or has_screen():
        return
    if _egl_works():
        os.environ["MUJOCO_GL"] = "egl"
    elif ctypes.util.find_library("OSMesa"):
        os.environ["MUJOCO_GL"] = "osmesa"
    else:
        raise RenderError(
            "There is no screen, and neither EGL nor OSMesa to draw without one: on Debian or "
            "Ubuntu run `apt-get install libegl1 libgl1-mesa-dri`, or libosmesa6."
        )


def _egl_works() -> bool:
    """Whether some EGL device opens; a library without a driver does not."""
    name = ctypes.util.find_library("EGL")
    if name is None:
        return False
    try:
        egl = ctypes.CDLL(name)
    except OSError:  # Found, and built for another machine.
        return False
    egl.eglGetProcAddress.restype = ctypes.c_void_p
    query = egl.eglGetProcAddress(b"eglQueryDevicesEXT")
    get_display = egl.eglGetProcAddress(b"eglGetPlatformDisplayEXT")
    if not query or not get_display:
        return False
    pointer = ctypes.c_void_p
    query_devices = ctypes.CFUNCTYPE(
        ctypes.c_uint, ctypes.c_int, ctypes.POINTER(pointer), ctypes.POINTER(ctypes.c_int)
    )(query)
    platform_display = ctypes.CFUNCTYPE(pointer, ctypes.c_uint, pointer, pointer)(get_display)
    egl.eglInitialize.argtypes = [pointer, pointer, pointer]
    devices = (pointer * _MOST_DEVICES)()
    count = ctypes.c_int(0)
    if not query_devices(_MOST_DEVICES, devices, ctypes.byref(count)):
        return False
    return any(
        egl.eglInitialize(platform_display(_EGL_PLATFORM_DEVICE_EXT, device, None), None, None)
        for device in devices[: count.value]
    )
