"""Cameras on board and outside: offscreen rendering without MuJoCo's shadows and reflections."""

from __future__ import annotations

import math
import os
import weakref
from typing import Any, Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.envs.opengl import choose_gl, open_context
from shapechanger.errors import RenderError
from shapechanger.vehicles.bodies.visuals import OUTSIDE_VIEW, OWN_VIEW

_COSTLY: Final = (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION)
_MOST_GEOMS: Final = 2000
_BEHIND_ALL_M: Final = 1000.0


# Ids of the processes that have rendered. A fork of one would deadlock on threads that it lacks.
_drawing: set[int] = set()


# Pixels of an outside view are the means of squares this wide, so that edges are smooth.
_SUPERSAMPLED: Final = 2
_LARGEST: Final = 4096  # Width and height; software renderers draw no larger images.


class _Renderer:
    """Renders views of models.

    The OpenGL context is opened for the first image, so that a process that has only built a
    camera, such as the parent of an `AsyncVectorEnv`, can be forked. A model's textures are loaded
    for its first image after another model's.
    """

    def __init__(self, size: tuple[int, int], hidden: int, supersampled: int = 1) -> None:
        if min(size) < 1:
            raise RenderError(f"An image cannot be {size[0]} x {size[1]} pixels.")
        self._width, self._height = (supersampled * side for side in size)
        self._gl: Any = None
        self._model: mujoco.MjModel | None = None
        self._rect = mujoco.MjrRect(0, 0, self._width, self._height)
        self._picture = np.empty((self._height, self._width, 3), np.uint8)
        self._camera = mujoco.MjvCamera()
        self._option = mujoco.MjvOption()
        self._option.geomgroup[hidden] = 0
        self._draws_shadows = hidden == OWN_VIEW

    def _open(self, model: mujoco.MjModel) -> None:
        """Create the rendering context of a model, whose offscreen buffer is resized."""
        if self._gl is None:
            if _drawing - {os.getpid()}:
                raise RenderError(
                    "A process that was forked after rendering cannot render: start it by "
                    "spawning, such as with gym.make_vec(..., vector_kwargs={'context': 'spawn'})."
                )
            choose_gl()
            self._gl = open_context(self._width, self._height)
            _drawing.add(os.getpid())
            self._finalizer = weakref.finalize(self, self._gl.free)
            self._finalizer.atexit = False
        self._gl.make_current()
        if self._model is not None:
            self._context.free()
        model.vis.global_.offwidth, model.vis.global_.offheight = self._width, self._height
        model.vis.quality.offsamples = model.vis.quality.shadowsize = 0
        self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_50.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
        self._scene = mujoco.MjvScene(model, _MOST_GEOMS)
        for flag in _COSTLY:
            self._scene.flags[flag] = 0
        self._model = model

    def _render(self, model: mujoco.MjModel, data: mujoco.MjData) -> NDArray[np.uint8]:
        """Return the image of a state, (height, width, 3); it is overwritten."""
        if model is not self._model:
            self._open(model)
        self._gl.make_current()
        everything = mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(
            model, data, self._option, None, self._camera, everything, self._scene
        )
        # Draw the ground before the shadows on it: MuJoCo draws translucent geoms from far to near,
        # and takes a large one for near.
        for geom in self._scene.geoms[: self._scene.ngeom] if self._draws_shadows else ():
            if geom.rgba[3] < 1.0 and geom.modelrbound > 1.0:
                geom.modelrbound = -_BEHIND_ALL_M
        mujoco.mjr_render(self._rect, self._scene, self._context)
        mujoco.mjr_readPixels(self._picture, None, self._rect, self._context)
        return self._picture[::-1]

    def close(self) -> None:
        """Free the OpenGL context; the next image opens another one."""
        if self._model is not None:
            self._gl.make_current()
            self._context.free()
            self._model = None
        if self._gl is not None:
            self._finalizer()
            self._gl = None


class OnboardCamera(_Renderer):
    """Renders the view of a camera in a model, without what is only seen from outside.

    Args:
        size: Width and height in pixels.
        name: Name of the camera.

    Raises:
        RenderError: If the size is out of range.
    """

    def __init__(self, size: tuple[int, int], name: str) -> None:
        super().__init__(size, OUTSIDE_VIEW)
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED.value
        self._name = name

    def picture(self, model: mujoco.MjModel, data: mujoco.MjData) -> NDArray[np.uint8]:
        """Render a state: RGB, shape (height, width, 3), in a new array.

        Raises a `RenderError` if no OpenGL context can be opened.
        """
        self._camera.fixedcamid = model.camera(self._name).id
        return self._render(model, data).copy()


class OutsideCamera(_Renderer):
    """Renders a model from outside, with smooth edges."""

    def __init__(self, size: tuple[int, int]) -> None:
        if max(size) > _LARGEST and min(size) > 0:
            raise RenderError(
                f"A view from outside has at most {_LARGEST} pixels a side, got "
                f"{size[0]} x {size[1]}."
            )
        super().__init__(size, OWN_VIEW, _SUPERSAMPLED)
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FREE.value
        self.size = size

    def picture(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        middle: NDArray[np.float64],
        distance_m: float,
        azimuth_rad: float,
        elevation_rad: float,
    ) -> NDArray[np.uint8]:
        """Render a state.

        Args:
            model: The model.
            data: Its state.
            middle: Point in the middle of the image, m, (3,).
            distance_m: Distance from it.
            azimuth_rad: Direction of view seen from above, from the x axis, counter-clockwise.
            elevation_rad: Angle of view above the horizon; negative looks down.
        """
        self._camera.lookat[:] = middle
        self._camera.distance = distance_m
        self._camera.azimuth = math.degrees(azimuth_rad)
        self._camera.elevation = math.degrees(elevation_rad)
        fine = self._render(model, data)
        squares = fine.reshape(self.size[1], _SUPERSAMPLED, self.size[0], _SUPERSAMPLED, 3)
        return (squares.mean(axis=(1, 3)) + 0.5).astype(np.uint8)
