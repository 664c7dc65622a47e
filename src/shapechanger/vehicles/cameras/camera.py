"""Cameras on board and outside, and faults of cameras.

Cameras render offscreen, without MuJoCo's shadows and reflections. Faults imitate bad light and a
bad lens, and test how well policies generalize to other images. They are pure functions on images
of any size, uint8, (H, W, 3).
"""

from __future__ import annotations

import functools
import math
import os
import weakref
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.envs.opengl import choose_gl, open_context
from shapechanger.errors import RenderError, require_known
from shapechanger.vehicles.bodies.visuals import OUTSIDE_VIEW, OWN_VIEW

_COSTLY: Final = (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION)
_MOST_GEOMS: Final = 2000
_BEHIND_ALL_M: Final = 1000.0
# Ids of the processes that have rendered. A fork does not copy threads, so rendering in a fork of
# one of these processes would deadlock.
_drawing: set[int] = set()
# A pixel of an outside view is the mean of a square this many pixels wide, so edges are smooth.
_SUPERSAMPLED: Final = 2
_LARGEST: Final = 4096  # Width and height of outside views; software renderers draw no larger.


class _Renderer:
    """Renders views of models; the first image of a new model loads the model's textures.

    The OpenGL context is opened for the first image. A process that has only built a camera, such
    as the parent of an `AsyncVectorEnv`, can therefore be forked.
    """

    def __init__(self, size: tuple[int, int], hidden: int, supersampled: int = 1) -> None:
        if min(size) < 1:
            raise RenderError(
                f"An image must have at least 1 x 1 pixels, got {size[0]} x {size[1]}."
            )
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
        """Create the rendering context of a model, and resize the model's offscreen buffer."""
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
        """Return the image of a state, (height, width, 3), which the next call overwrites."""
        if model is not self._model:
            self._open(model)
        self._gl.make_current()
        shown = mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(model, data, self._option, None, self._camera, shown, self._scene)
        # Draw the ground before the shadows on it. MuJoCo draws translucent geoms from far to near
        # and counts a large one as near.
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
    """Renders the view of a named camera of a model, without the geoms of outside views."""

    def __init__(self, size: tuple[int, int], name: str) -> None:
        super().__init__(size, OUTSIDE_VIEW)
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED.value
        self._name = name

    def picture(self, model: mujoco.MjModel, data: mujoco.MjData) -> NDArray[np.uint8]:
        """Render a state: RGB, shape (height, width, 3), in a new array."""
        self._camera.fixedcamid = model.camera(self._name).id
        return self._render(model, data).copy()


class OutsideCamera(_Renderer):
    """Renders a model from outside, with smooth edges."""

    def __init__(self, size: tuple[int, int]) -> None:
        if max(size) > _LARGEST and min(size) > 0:
            raise RenderError(
                f"A view from outside must have at most {_LARGEST} pixels a side, got "
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
        """Render a state from `distance_m` away; `middle`, m, (3,), is in the middle of the image.

        The azimuth is the direction of view from the x axis, counter-clockwise seen from above. The
        elevation is the angle of view above the horizon; negative looks down.
        """
        self._camera.lookat[:] = middle
        self._camera.distance = distance_m
        self._camera.azimuth = math.degrees(azimuth_rad)
        self._camera.elevation = math.degrees(elevation_rad)
        fine = self._render(model, data)
        squares = fine.reshape(self.size[1], _SUPERSAMPLED, self.size[0], _SUPERSAMPLED, 3)
        return (squares.mean(axis=(1, 3)) + 0.5).astype(np.uint8)


Picture = NDArray[np.uint8]

Corruption = Callable[[Picture, int], Picture]
"""Function from an image and a seed, >= 0 and constant within an episode, to an image."""

# Factors on red, green and blue at night with the camera's highest gain, and a gamma that darkens
# shadows. At a quarter of these factors, which imitates no gain, a person saw nothing.
_NIGHT_SHARE: Final = (0.46, 0.5, 0.66)
_NIGHT_GAMMA: Final = 1.1
_NIGHT_NOISE: Final = 9.0  # Standard deviation of a sensor's noise at the highest gain, of 255.
# Levels, of 255, of the peak of glare, and of the veil that it adds everywhere in addition.
_GLARE_PEAK, _GLARE_VEIL = 230.0, 28.0
_BLUR: Final = 0.0125  # Standard deviation, as a share of the width: 2 of 160 pixels.
# Ranges of the number of spots on a dirty lens, the radius of a spot as a share of the image's
# width, and the share of the light that it absorbs.
_SPOTS, _SPOT_RADIUS, _SPOT_DEPTH = (8, 14), (0.02, 0.085), (0.45, 0.85)
_DIRT: Final = np.array([52.0, 46.0, 34.0], np.float32)
# Noise is cut from one long strip, because drawing noise for each image would take most of the
# time. The strip has at least this many values, and at least twice as many as an image.
_STRIP: Final = 1 << 19
_KEPT: Final = 64


def night(picture: Picture, seed: int) -> Picture:
    """Roughly halve the brightness of an image, tint it blue, and add noise of 9 levels."""
    dark = np.empty(picture.shape, np.float32)
    for channel, table in enumerate(_night_tables()):
        dark[..., channel] = table[picture[..., channel]]
    dark += _NIGHT_NOISE * _noise(picture, seed)
    return _bytes(dark)


def glare(picture: Picture, seed: int) -> Picture:
    """Add light shining into the lens from the upper half of an image: up to 258 levels."""
    return _bytes(picture + _glare(seed, *picture.shape[:2]))


def blur(picture: Picture, seed: int) -> Picture:
    """Defocus an image by 1.25 % of its width; the seed has no effect."""
    from scipy.ndimage import uniform_filter  # Takes long to import.

    del seed
    variance = (_BLUR * picture.shape[1]) ** 2
    # Two box filters over w = 2 r + 1 pixels have the variance 2 (w^2 - 1) / 12 = 2 (r^2 + r) / 3.
    reach = max(1, round(0.5 * (np.sqrt(6.0 * variance + 1.0) - 1.0)))
    result, size = picture.astype(np.float64), (2 * reach + 1, 2 * reach + 1, 1)
    for _ in range(2):
        result = uniform_filter(result, size, mode="nearest")
    return _bytes(result)


def dirt(picture: Picture, seed: int) -> Picture:
    """Add 8 to 14 spots of mud that absorb 45 to 85 % of the light; the seed places them."""
    keeps, mud = _dirt(seed, *picture.shape[:2])
    return _bytes(picture * keeps + mud)


CORRUPTIONS: Final[Mapping[str, Corruption]] = MappingProxyType(
    {"night": night, "glare": glare, "blur": blur, "dirt": dirt}
)
"""Camera faults, keyed by name."""


def find_corruption(name: str) -> Corruption:
    """Find a camera fault by name."""
    require_known("lens", CORRUPTIONS, name)
    return CORRUPTIONS[name]


def _bytes(levels: NDArray[np.floating[Any]]) -> Picture:
    """Round levels and clip them to 0 to 255; `levels` is overwritten."""
    levels += 0.5
    return np.clip(levels, 0.0, 255.0, out=levels).astype(np.uint8)


@functools.cache
def _night_tables() -> tuple[NDArray[np.float32], ...]:
    level = np.linspace(0.0, 1.0, 256)
    return tuple((255.0 * s * level**_NIGHT_GAMMA).astype(np.float32) for s in _NIGHT_SHARE)


@functools.lru_cache(4)
def _strip(length: int) -> NDArray[np.float32]:
    return np.random.default_rng(20_26).standard_normal(length, np.float32)


def _noise(picture: Picture, seed: int) -> NDArray[np.float32]:
    """Standard normal noise of an image's shape, determined by the seed and the image."""
    # Different images nearly always have different sums.
    mixed = (int(picture.sum(dtype=np.int64)) * 2_654_435_761 + seed * 40_503) & 0xFFFF_FFFF
    strip = _strip(max(_STRIP, 2 * picture.size))
    start = mixed % (strip.size - picture.size)
    return strip[start : start + picture.size].reshape(picture.shape)


@functools.lru_cache(_KEPT)
def _glare(seed: int, height: int, width: int) -> NDArray[np.float32]:
    """Levels that glare adds, (H, W, 3)."""
    rng = np.random.default_rng([seed, 1])
    x, y = rng.uniform(0.15, 0.85) * width, rng.uniform(0.05, 0.4) * height
    rows, columns = np.mgrid[:height, :width].astype(np.float32)
    away = np.hypot(columns - x, rows - y) / width
    spot = np.exp(-((away / rng.uniform(0.09, 0.16)) ** 2))
    halo = np.exp(-away / 0.3)
    # Smeared and cheap lenses cause a horizontal streak.
    streak = np.exp(-(((rows - y) / (0.015 * width)) ** 2)) * halo
    light = _GLARE_PEAK * np.minimum(1.0, spot + 0.45 * halo + 0.3 * streak) + _GLARE_VEIL
    return (light[..., None] * np.array([1.0, 0.97, 0.86])).astype(np.float32)


@functools.lru_cache(_KEPT)
def _dirt(seed: int, height: int, width: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Transmittance of dirt, (H, W, 1), and the light that dirt adds, (H, W, 3)."""
    rng = np.random.default_rng([seed, 2])
    rows, columns = np.mgrid[:height, :width].astype(np.float32)
    keeps = np.ones((height, width), np.float32)
    for _ in range(int(rng.integers(_SPOTS[0], _SPOTS[1] + 1))):
        x, y = rng.uniform(0.0, width), rng.uniform(0.0, height)
        radius, depth = rng.uniform(*_SPOT_RADIUS) * width, rng.uniform(*_SPOT_DEPTH)
        across, down = (columns - x) / rng.uniform(0.8, 1.3), rows - y
        # Dirt on the lens is out of focus, so it has soft edges.
        soft = np.clip(1.5 - np.hypot(across, down) / radius, 0.0, 1.0)
        keeps *= 1.0 - np.float32(depth) * soft
    keeps = keeps[..., None]
    return keeps, (1.0 - keeps) * _DIRT
