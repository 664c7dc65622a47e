"""What stands or floats in the way, as patches."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

import numpy as np

from shapechanger.worlds.course import Course, Thing
from shapechanger.worlds.scene.light import Light
from shapechanger.worlds.scene.patches import Patches
from shapechanger.worlds.scene.solids import add_box, add_turned

__all__ = ["thing_patches"]

# Parts of each thing, from below: half sizes and middle as shares of its length, width and height,
# then the stuff. A box from -0.5 to 0.5 in x and y, and 0 to 1 in z, is the whole thing.
_Part = tuple[tuple[float, float, float], tuple[float, float, float], str]
_LEG: Final = (0.05, 0.06, 0.4)
_BOXES: Final[Mapping[str, tuple[_Part, ...]]] = MappingProxyType(
    {
        "box": (((0.5, 0.5, 0.5), (0.0, 0.0, 0.5), "cardboard"),),
        "cabinet": (((0.5, 0.5, 0.5), (0.0, 0.0, 0.5), "cabinet"),),
        "crate": (((0.5, 0.5, 0.5), (0.0, 0.0, 0.5), "crate"),),
        "bench": (
            (_LEG, (-0.4, -0.38, 0.4), "black"),
            (_LEG, (-0.4, 0.38, 0.4), "black"),
            (_LEG, (0.4, -0.38, 0.4), "black"),
            (_LEG, (0.4, 0.38, 0.4), "black"),
            ((0.5, 0.5, 0.15), (0.0, 0.0, 0.85), "dark wood"),
        ),
        "dinghy": (
            ((0.34, 0.5, 0.5), (-0.16, 0.0, 0.5), "hull"),
            ((0.10, 0.38, 0.5), (0.28, 0.0, 0.5), "hull"),
            ((0.06, 0.22, 0.5), (0.44, 0.0, 0.5), "hull"),
            ((0.04, 0.42, 0.06), (-0.05, 0.0, 1.05), "wood"),
        ),
    }
)
# Turned bodies: radius as a share of the diameter, and height as a share of the height.
_Turned = tuple[tuple[tuple[float, float], ...], str]
_ROUND: Final[Mapping[str, tuple[_Turned, ...]]] = MappingProxyType(
    {
        "bin": ((((0.42, 0.0), (0.5, 0.95), (0.5, 1.0), (0.0, 1.0)), "bin"),),
        "plant": (
            (((0.3, 0.0), (0.4, 0.3), (0.0, 0.3)), "clay"),
            (((0.1, 0.28), (0.5, 0.5), (0.48, 0.75), (0.2, 0.98), (0.0, 1.0)), "leaves"),
        ),
        "cone": ((((0.5, 0.0), (0.5, 0.05), (0.36, 0.06), (0.05, 1.0), (0.0, 1.0)), "cone"),),
        "post": ((((0.5, 0.0), (0.5, 0.96), (0.3, 1.0), (0.0, 1.0)), "post"),),
        "tree": (
            (((0.5, 0.0), (0.38, 0.1), (0.34, 0.5), (0.0, 0.5)), "bark"),
            (((0.3, 0.4), (1.6, 0.55), (1.8, 0.72), (1.0, 0.92), (0.0, 1.0)), "leaves"),
        ),
        "buoy": ((((0.4, 0.0), (0.5, 0.25), (0.42, 0.5), (0.12, 0.8), (0.0, 1.0)), "buoy"),),
    }
)


def thing_patches(course: Course, light: Light) -> Patches:
    """All things of a course; they share one texture."""
    patches = Patches()
    for thing in course.things:
        bright = float(light.on_ground(np.array([thing.x, thing.y])))
        if thing.is_round:
            for outline, stuff in _ROUND[thing.kind]:
                profile = np.array(outline) * (thing.length, thing.height)
                add_turned(patches, thing.x, thing.y, profile, stuff, bright)
        else:
            _add_boxes(patches, thing, bright)
    return patches


def _add_boxes(patches: Patches, thing: Thing, bright: float) -> None:
    size = np.array([thing.length, thing.width, thing.height])
    cos, sin = np.cos(thing.yaw), np.sin(thing.yaw)
    for half, place, stuff in _BOXES[thing.kind]:
        dx, dy, dz = np.array(place) * size
        middle = np.array([thing.x + cos * dx - sin * dy, thing.y + sin * dx + cos * dy, dz])
        add_box(patches, middle, np.array(half) * size, thing.yaw, stuff, bright)
