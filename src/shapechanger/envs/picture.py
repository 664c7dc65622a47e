"""A picture of a body as it stands, for reports and for the command line."""

from __future__ import annotations

import copy
from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.envs.renderer import Renderer
from shapechanger.errors import RenderError
from shapechanger.headless import choose_gl

__all__ = ["body_reach", "draw"]

_AZIMUTH_DEG: Final = 105.0
_ELEVATION_DEG: Final = -25.0
# With MuJoCo's default angle of view, 45 degrees, a ball of radius 1 fills the height at 2.6; the
# rest is margin.
_DISTANCE_PER_REACH: Final = 3.0
# A model without lamps is lit by the camera's own, which is dim by default.
_HEADLIGHT: Final = 0.5
# Where the depth buffer, from 0 to 1, holds nothing.
_FARTHEST: Final = 1.0
_BACKGROUND: Final = 235
# Pixels; graphics cards draw no picture much larger than this.
_LARGEST: Final = 8192


def body_reach(model: mujoco.MjModel, pose: NDArray[np.float64]) -> float:
    """How far from the middle of the body its farthest point is at `pose` (nq,), m."""
    middle, places, sizes = _geoms(model, _posed(model, pose))
    return float((np.linalg.norm(places - middle, axis=1) + sizes).max())


def draw(
    model: mujoco.MjModel, pose: NDArray[np.float64], width: int, height: int, reach: float
) -> NDArray[np.uint8]:
    """The body at `pose` (nq,), shape (height, width, 3), with `reach` metres around its middle.

    Bodies drawn with the same reach are drawn to the same scale.

    Raises:
        RenderError: If the size is no size, or there is nothing to draw with.
    """
    if not (1 <= width <= _LARGEST and 1 <= height <= _LARGEST):
        raise RenderError(
            f"A picture is 1 to {_LARGEST} pixels wide and high, got {width} x {height}."
        )
    choose_gl()
    lit = _well_lit(model, width, height)
    data = _posed(lit, pose)
    camera = {
        "lookat": _geoms(lit, data)[0],
        "distance": _DISTANCE_PER_REACH * reach,
        "azimuth": _AZIMUTH_DEG,
        "elevation": _ELEVATION_DEG,
    }
    renderer = Renderer(lit, data, camera, width, height, camera_id=-1, shadows=True)
    try:
        picture, depth = renderer.render("rgbd_tuple")
    finally:
        renderer.close()
    result = np.array(picture, dtype=np.uint8)
    if not has_sky(lit):
        # A model without a sky is drawn before black, in which dark bodies drown.
        result[depth >= _FARTHEST] = _BACKGROUND
    return result


def has_sky(model: mujoco.MjModel) -> bool:
    """Whether the model brings its own background."""
    return bool((model.tex_type == mujoco.mjtTexture.mjTEXTURE_SKYBOX).any())


def _well_lit(model: mujoco.MjModel, width: int, height: int) -> mujoco.MjModel:
    """A copy of the model that can be drawn this large, and seen."""
    result = copy.copy(model)
    result.vis.global_.offwidth = max(result.vis.global_.offwidth, width)
    result.vis.global_.offheight = max(result.vis.global_.offheight, height)
    if not result.nlight:
        result.vis.headlight.ambient[:] = _HEADLIGHT
        result.vis.headlight.diffuse[:] = _HEADLIGHT
    return result


def _posed(model: mujoco.MjModel, pose: NDArray[np.float64]) -> mujoco.MjData:
    data = mujoco.MjData(model)
    data.qpos[:] = pose
    mujoco.mj_forward(model, data)
    return data


def _geoms(
    model: mujoco.MjModel, data: mujoco.MjData
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """The middle of the body's geoms, their places (n, 3), and their radii (n,), m."""
    of_body = model.geom_bodyid > 0
    places = data.geom_xpos[of_body]
    middle = 0.5 * (places.min(axis=0) + places.max(axis=0))
    return middle, places, model.geom_rbound[of_body]
