"""Gymnasium's renderer, with others drawing in the same process."""

from __future__ import annotations

import functools
import weakref
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any, Final, cast

import mujoco
from gymnasium.envs.mujoco.mujoco_rendering import MujocoRenderer, OffScreenViewer, WindowViewer

from shapechanger.errors import RenderError
from shapechanger.headless import require_context

__all__ = ["Renderer"]

# Frames with at most this many pixels are for cameras that learn rather than for people.
_MOST_CAMERA_PIXELS: Final = 256 * 256
# What is drawn once more for each light and each mirror.
_COSTLY: Final = (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION)


class Renderer(MujocoRenderer):
    """A renderer that touches what it drew itself, and nothing else.

    OpenGL draws into, and deletes from, whichever context is current. Gymnasium makes a context
    current only when it is new: with two of them one draws black frames, and closing one deletes
    the textures of the other. It also shuts GLFW down, and all windows with it. And its free camera
    stays where it is while the robot runs out of the picture.

    Without a graphics card, shadows, reflections and smoothed edges take nearly all of the time
    that a small frame takes; a window always has them.

    Args:
        *arguments: As Gymnasium's renderer.
        shadows: Whether frames have shadows, reflections and smoothed edges; None draws them in
            frames of more than 256 x 256 pixels.
        follow: Number of the body that a free camera follows; None for a camera that stays.
        **more: As Gymnasium's renderer.
    """

    _viewers: dict[str, OffScreenViewer | WindowViewer]

    def __init__(
        self,
        *arguments: Any,
        follow: int | None = None,
        shadows: bool | None = None,
        **more: Any,
    ) -> None:
        super().__init__(*arguments, **more)  # pyright: ignore[reportUnknownMemberType]
        self._follow = follow
        pixels = (self.width or 0) * (self.height or 0)
        self._plain = pixels <= _MOST_CAMERA_PIXELS if shadows is None else not shadows
        # An env that is dropped without being closed must not take the pictures of another along.
        weakref.finalize(self, _free, self._viewers).atexit = False

    def render(self, render_mode: str | None) -> Any:
        """A frame of `render_mode`, as Gymnasium's renderer draws it.

        Raises:
            RenderError: If nothing can be drawn here.
        """
        if render_mode != "human":
            _require_context_once()
        try:
            viewer = cast("Any", self._get_viewer(render_mode))
        except mujoco.FatalError as error:
            raise RenderError(f"MuJoCo cannot draw here: {error}.") from error
        viewer.make_context_current()
        if self._follow is not None and self.camera_id == -1:
            viewer.cam.lookat[:] = self.data.xpos[self._follow]
        return cast("Any", super().render(render_mode))

    def _get_viewer(self, render_mode: str | None) -> OffScreenViewer | WindowViewer:
        viewers: Any = super()
        if not self._plain or render_mode == "human" or render_mode in self._viewers:
            return viewers._get_viewer(render_mode)
        with _small_buffers(self.model):
            viewer = viewers._get_viewer(render_mode)
        for flag in _COSTLY:
            viewer.scn.flags[flag] = 0
        return viewer

    def close(self) -> None:
        """Free the contexts; the next frame is drawn in a new one."""
        self.viewer = None
        _free(self._viewers)


@functools.cache
def _require_context_once() -> None:
    """Refuse where no context opens; asked once, because what opens once opens again."""
    require_context()


@contextmanager
def _small_buffers(model: mujoco.MjModel) -> Generator[None]:
    """Let a context that is made meanwhile have no samples to smooth and no maps of shadows."""
    quality = model.vis.quality
    before = quality.offsamples, quality.shadowsize
    quality.offsamples = quality.shadowsize = 0
    try:
        yield
    finally:
        quality.offsamples, quality.shadowsize = before


def _free(viewers: dict[str, OffScreenViewer | WindowViewer]) -> None:
    """Free each viewer's part of OpenGL, and then its context."""
    while viewers:
        _, viewer = viewers.popitem()
        viewer.make_context_current()
        viewer.con.free()
        viewer.free()
