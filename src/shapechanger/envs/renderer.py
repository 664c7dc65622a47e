"""Gymnasium's renderer, with others drawing in the same process."""

from __future__ import annotations

import functools
import weakref
from typing import Any, cast

import mujoco
from gymnasium.envs.mujoco.mujoco_rendering import MujocoRenderer, OffScreenViewer, WindowViewer

from shapechanger.envs.headless import require_context
from shapechanger.errors import RenderError

__all__ = ["Renderer"]


class Renderer(MujocoRenderer):
    """A renderer that touches what it drew itself, and nothing else.

    OpenGL draws into, and deletes from, whichever context is current. Gymnasium makes a context
    current only when it is new: with two of them one draws black frames, and closing one deletes
    the textures of the other. It also shuts GLFW down, and all windows with it. And its free camera
    stays where it is while the robot runs out of the picture.

    Args:
        *arguments: As Gymnasium's renderer.
        follow: Number of the body that a free camera follows; None for a camera that stays.
        **more: As Gymnasium's renderer.
    """

    _viewers: dict[str, OffScreenViewer | WindowViewer]

    def __init__(self, *arguments: Any, follow: int | None = None, **more: Any) -> None:
        super().__init__(*arguments, **more)  # pyright: ignore[reportUnknownMemberType]
        self._follow = follow
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

    def close(self) -> None:
        """Free the contexts; the next frame is drawn in a new one."""
        self.viewer = None
        _free(self._viewers)


@functools.cache
def _require_context_once() -> None:
    """Refuse where no context opens; asked once, because what opens once opens again."""
    require_context()


def _free(viewers: dict[str, OffScreenViewer | WindowViewer]) -> None:
    """Free each viewer's part of OpenGL, and then its context."""
    while viewers:
        _, viewer = viewers.popitem()
        viewer.make_context_current()
        viewer.con.free()
        viewer.free()
