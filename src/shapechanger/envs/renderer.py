"""Render MuJoCo models: Gymnasium's renderer made safe for several envs, and still images."""

from __future__ import annotations

import copy
import functools
import weakref
from collections.abc import Generator, Sequence
from contextlib import closing, contextmanager
from typing import Any, Final, cast

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.envs.opengl import choose_gl, open_context
from shapechanger.errors import RenderError, needing_extra

with needing_extra("sim"):
    from gymnasium.envs.mujoco.mujoco_rendering import MujocoRenderer

_Floats = NDArray[np.float64]

# Frames of at most this many pixels are camera observations rather than films.
_MOST_CAMERA_PIXELS: Final = 256 * 256
# Effects that render the scene again for each light and each mirror.
_COSTLY: Final = (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION)
# Width of the squares that floors consist of in frames with shadows, m. In large squares,
# coordinates in the shadow map are inexact enough that floors shadow themselves in places.
_SQUARE_M: Final = 0.5


@functools.cache
def _require_context() -> None:
    """Check once that MuJoCo can render, because Gymnasium's renderer gives no clear error."""
    open_context(16, 16).free()


class Renderer(MujocoRenderer):
    """Renderer that is independent of other renderers in the process.

    OpenGL draws into and deletes from the current context. Gymnasium makes a context current only
    when it is new, so one of two envs renders black frames, and closing one deletes the textures of
    the other. It also terminates GLFW with all windows, and its free camera does not follow the
    robot. Here a free camera follows the body with the number `follow`; with None it is fixed.

    Without a GPU, shadows, reflections and smoothed edges take nearly all of the time of a small
    frame: by default, only frames of more than 256 x 256 pixels have them. A window always does.
    """

    _viewers: dict[str, Any]

    def __init__(
        self,
        *arguments: Any,
        follow: int | None = None,
        shadows: bool | None = None,
        **more: Any,
    ) -> None:
        super().__init__(*arguments, **more)  # pyright: ignore[reportUnknownMemberType]
        self._follow = follow
        self._floors = _floors(self.model)
        pixels = (self.width or 0) * (self.height or 0)
        self._plain = pixels <= _MOST_CAMERA_PIXELS if shadows is None else not shadows
        # An env that is garbage-collected unclosed must not delete the contexts of another.
        weakref.finalize(self, _free, self._viewers).atexit = False

    def render(self, render_mode: str | None, markers: Sequence[dict[str, Any]] = ()) -> Any:
        """Return a frame like Gymnasium's renderer; markers are arguments of its `add_marker`."""
        if render_mode != "human":
            _require_context()
        try:
            viewer = self._get_viewer(render_mode)
        except mujoco.FatalError as error:
            raise RenderError(f"MuJoCo cannot draw here: {error}.") from error
        viewer.make_context_current()
        if self._follow is not None and self.camera_id == -1:
            viewer.cam.lookat[:] = self.data.xpos[self._follow]
        for marker in markers:
            viewer.add_marker(**marker)
        with _restored(self.data.geom_xpos):
            # Floors are infinite for contacts but not in images, so floors below a body that the
            # camera follows are moved along, by whole tiles so that they seem fixed.
            for floor, period in self._floors.items() if self._follow is not None else ():
                place = self.data.geom_xpos[floor, :2]
                place += np.round((self.data.xpos[self._follow, :2] - place) / period) * period
            return cast("Any", super()).render(render_mode)

    def _get_viewer(self, render_mode: str | None) -> Any:
        new: Any = super()._get_viewer
        if render_mode in self._viewers:
            return new(render_mode)
        if not self._plain or render_mode == "human":
            with _restored(self.model.geom_size):  # Contacts do not read the size of a square.
                self.model.geom_size[[*self._floors], 2] = _SQUARE_M
                return new(render_mode)
        quality = self.model.vis.quality
        before = quality.offsamples, quality.shadowsize
        quality.offsamples = quality.shadowsize = 0  # Neither multisampling nor shadow maps.
        try:
            viewer = new(render_mode)
        finally:
            quality.offsamples, quality.shadowsize = before
        for flag in _COSTLY:
            viewer.scn.flags[flag] = 0
        return viewer

    def close(self) -> None:
        """Free the contexts; the next frame is drawn in a new one."""
        self.viewer = None
        _free(self._viewers)


def _floors(model: mujoco.MjModel) -> dict[int, _Floats]:
    """Return the level floors of finite size with tiles, and the tiles' period along x and y, m."""
    found: dict[int, _Floats] = {}
    for floor in np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE).tolist():
        material, size = model.geom_matid[floor], model.geom_size[floor, :2]
        level = model.geom_bodyid[floor] == 0 and model.geom_quat[floor, 0] == 1.0
        if level and material >= 0 and size.all() and not model.mat_texuniform[material]:
            found[floor] = 2.0 * size / model.mat_texrepeat[material]
    return found


@contextmanager
def _restored(array: _Floats) -> Generator[None]:
    """Restore the numbers of an array at the end of this block."""
    before = array.copy()
    try:
        yield
    finally:
        array[:] = before


def _free(viewers: dict[str, Any]) -> None:
    """Free the OpenGL resources and then the context of each viewer."""
    while viewers:
        _, viewer = viewers.popitem()
        viewer.make_context_current()
        viewer.con.free()
        viewer.free()


# View of still images. At MuJoCo's default field of view, 45 degrees, a sphere of radius 1 fills
# the height at a distance of 2.6; the rest is margin.
_VIEW: Final = {"azimuth": 105.0, "elevation": -25.0}
_DISTANCE_PER_REACH: Final = 3.0
# Largest width and height, pixels; GPUs do not draw much larger images.
_LARGEST: Final = 8192


def body_reach(model: mujoco.MjModel, pose: _Floats) -> float:
    """Return the distance from the middle of a body in a pose (nq,) to its farthest point, m."""
    middle, places, sizes = _geoms(model, _posed(model, pose))
    return float((np.linalg.norm(places - middle, axis=1) + sizes).max())


def draw(
    model: mujoco.MjModel, pose: _Floats, width: int, height: int, reach: float
) -> NDArray[np.uint8]:
    """Return an image of a body in a pose (nq,), shape (height, width, 3).

    `reach` is the radius in view around the middle of the body, m: bodies drawn with the same reach
    have the same scale. The model must have a sky and a light, see `prepare_scene`.
    """
    if not (1 <= width <= _LARGEST and 1 <= height <= _LARGEST):
        raise RenderError(
            f"An image must be 1 to {_LARGEST} pixels wide and high, got {width} x {height}."
        )
    choose_gl()
    model = copy.copy(model)
    buffer = model.vis.global_
    buffer.offwidth, buffer.offheight = max(buffer.offwidth, width), max(buffer.offheight, height)
    data = _posed(model, pose)
    camera = {**_VIEW, "lookat": _geoms(model, data)[0], "distance": _DISTANCE_PER_REACH * reach}
    renderer = Renderer(model, data, camera, width, height, camera_id=-1, shadows=True)
    with closing(renderer):
        return np.array(renderer.render("rgb_array"), dtype=np.uint8)


def _posed(model: mujoco.MjModel, pose: _Floats) -> mujoco.MjData:
    data = mujoco.MjData(model)
    data.qpos[:] = pose
    mujoco.mj_forward(model, data)
    return data


def _geoms(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[_Floats, _Floats, _Floats]:
    """Return the middle of the body's geoms, their places (n, 3), and their radii (n,), m."""
    of_body = model.geom_bodyid > 0
    places, radii = data.geom_xpos[of_body], model.geom_rbound[of_body]
    if not len(places):
        # The file of a robot may have no shapes; its links then count as points.
        places, radii = data.xpos[1:], np.zeros(model.nbody - 1)
    return 0.5 * (places.min(axis=0) + places.max(axis=0)), places, radii


# Brightness of the headlight for models without lights; its default is dim.
_HEADLIGHT: Final = [0.5] * 3
_BACKGROUND: Final = [235 / 255.0] * 3
# Geoms of the groups 3 to 5 are not drawn unless a viewer enables these groups.
_HIDDEN_GROUP: Final = 3
_DARK_TILE: Final = [0.42, 0.45, 0.48]
_LIGHT_TILE: Final = [0.54, 0.57, 0.6]
# Ambient light, and diffuse light of each light of a model; shadows have ambient light only.
_AMBIENT: Final = [0.3] * 3
_DIFFUSE: Final = [0.7] * 3
# Least height of a directional light, m, above all bodies of the catalogue.
_LIGHT_HEIGHT_M: Final = 4.0
# Half the width of shadow maps, in extents of the model.
_SHADOW_CLIP: Final = 0.3


def prepare_scene(spec: mujoco.MjSpec, *, bare_floors: bool = False) -> None:
    """Improve the appearance of a model's floor, lights and sky, without effect on the physics.

    Sensors are not affected either: range finders detect a geom by its opacity, which is unchanged.
    Planes without a material are drawn only with `bare_floors`; the double pendulum has such a
    plane, far below it.

    Gymnasium's floors are black and white and mirror half of the light: they distract from the
    body, and flicker towards the horizon; in frames with shadows they turn green, and the shadows
    are black. Its lights are lower than large bodies, and their shadow maps, which do not follow a
    body that walks, leave dark stripes far from it. The pendulums' models have neither a sky nor a
    light: their frames would be dark shapes on black.
    """
    for texture in spec.textures:
        if texture.builtin == mujoco.mjtBuiltin.mjBUILTIN_CHECKER:
            texture.rgb1, texture.rgb2 = _DARK_TILE, _LIGHT_TILE
    for geom in spec.geoms:
        if geom.type == mujoco.mjtGeom.mjGEOM_PLANE:
            if geom.material:
                geom.rgba = [1.0, 1.0, 1.0, geom.rgba[3]]
            elif not bare_floors:
                geom.group = _HIDDEN_GROUP
    for material in spec.materials:
        material.reflectance = 0.0
    headlight = spec.visual.headlight
    if spec.lights:
        headlight.ambient = _AMBIENT
    else:
        headlight.ambient = headlight.diffuse = _HEADLIGHT
    for light in spec.lights:
        light.diffuse = _DIFFUSE
        if light.type == mujoco.mjtLightType.mjLIGHT_DIRECTIONAL:
            light.pos = [light.pos[0], light.pos[1], max(light.pos[2], _LIGHT_HEIGHT_M)]
            light.mode = mujoco.mjtCamLight.mjCAMLIGHT_TRACKCOM
    spec.visual.map.shadowclip = _SHADOW_CLIP
    skybox = mujoco.mjtTexture.mjTEXTURE_SKYBOX
    if not any(texture.type == skybox for texture in spec.textures):
        sky = spec.add_texture(name="sky", type=skybox, builtin=mujoco.mjtBuiltin.mjBUILTIN_FLAT)
        sky.width = sky.height = 8
        sky.rgb1 = sky.rgb2 = _BACKGROUND


def halve_textures(spec: mujoco.MjSpec) -> None:
    """Halve the width and height of all procedural textures of bodies and skies.

    They take most of the memory of a compiled model. Floors are not changed, because the edges of
    their tiles would blur.
    """
    for texture in spec.textures:
        if texture.builtin and texture.type != mujoco.mjtTexture.mjTEXTURE_2D:
            texture.width = max(1, texture.width // 2)
            texture.height = max(1, texture.height // 2)
