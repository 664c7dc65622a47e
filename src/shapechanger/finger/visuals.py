"""Visuals of the finger: bones, skin and tendons, and a legend, paths and trails in frames.

What this module adds has no mass, collisions or forces. The phalanges of
`shapechanger.finger.model`, coloured as skin, have the mass, and its fixed tendons move them.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from types import MappingProxyType
from typing import Any, Final

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from shapechanger.finger.anatomy import PHALANGES, PHALANX_LENGTH_M, TENDONS

_HAND: Final = "hand"
"""Name of the hand's body; its axes are the finger's, at the knuckle."""


TendonRoute = tuple[tuple[str, float, float, float] | str, ...]
"""Points that a tendon passes, from the wrist to its end.

A point is the name of a bone with x, y and z, mm, in the bone's frame: x along the bone from its
joint, y radial, z dorsal. "MCP", "PIP" or "DIP" is a joint whose back the tendon wraps around.
"""


def _on(body: str, *points: tuple[float, float, float]) -> TendonRoute:
    return tuple((body, *point) for point in points)


_P, _M, _D = "proximal", "middle", "distal"


def _extensor(y: float) -> TendonRoute:
    """Route over the knuckle and the middle of the hood to the base of the distal phalanx."""
    return (
        *_on(_HAND, (-58.0, 1.8 * y, 7.0), (-12.0, y, 7.0)),
        "MCP",
        *_on(_P, (12.0, y, 6.2), (36.0, 0.7 * y, 5.8)),
        "PIP",
        *_on(_M, (8.0, 0.7 * y, 5.2), (20.0, 0.5 * y, 4.6)),
        "DIP",
        *_on(_D, (4.5, 0.4 * y, 3.8)),
    )


def _to_the_hood(side: float) -> TendonRoute:
    """Route from the side of the proximal phalanx into the hood, and along its lateral band."""
    return (
        *_on(_P, (9.0, 7.0 * side, -3.5), (30.0, 5.0 * side, 3.6)),
        "PIP",
        *_on(_M, (7.0, 3.2 * side, 4.7), (20.0, 1.6 * side, 4.4)),
        "DIP",
        *_on(_D, (4.5, 1.2 * side, 3.6)),
    )


# Sides and order follow anatomical atlases; the positions are chosen for visibility.
_TENDON_ROUTES: Final[Mapping[str, tuple[TendonRoute, ...]]] = MappingProxyType(
    {
        # FDP runs deep to FDS, then between the slips of FDS to the base of the distal phalanx.
        "FDP": (
            (
                *_on(_HAND, (-58.0, 0.6, -6.6), (-11.0, 0.0, -7.0)),
                *_on(_P, (11.0, 0.0, -6.6), (24.0, 0.0, -7.0), (36.0, 0.0, -6.6)),
                *_on(_M, (9.0, 0.0, -5.8), (19.0, 0.0, -5.4)),
                *_on(_D, (6.0, 0.0, -3.4)),
            ),
        ),
        # FDS is nearest to the palm. It splits around FDP, and each slip ends at one side of the
        # middle phalanx.
        "FDS": tuple(
            (
                *_on(_HAND, (-58.0, -0.6, -8.8), (-11.0, 0.0, -9.2)),
                *_on(_P, (11.0, 0.0, -8.6), (24.0, 2.2 * side, -7.0), (36.0, 2.8 * side, -6.0)),
                *_on(_M, (10.0, 2.8 * side, -3.6)),
            )
            for side in (1.0, -1.0)
        ),
        # EIP runs on the ulnar side of EDC.
        "EIP": (_extensor(-1.5),),
        "EDC": (_extensor(1.5),),
        # LUM runs from the tendon of FDP in the palm, radially and palmar of the knuckle's axis.
        "LUM": ((*_on(_HAND, (-40.0, 1.6, -6.6), (-10.0, 6.2, -6.0)), *_to_the_hood(1.0)),),
        # DI runs from the web between thumb and finger to the base of the proximal phalanx.
        "DI": (
            (
                *_on(_HAND, (-42.0, 5.0, 1.5), (-9.0, 7.6, -1.0)),
                *_on(_P, (4.0, 7.6, -1.2), (10.0, 4.6, -0.8)),
            ),
        ),
        "PI": ((*_on(_HAND, (-42.0, -5.0, -1.5), (-9.0, -7.2, -3.6)), *_to_the_hood(-1.0)),),
    }
)
"""Routes of each tendon from the wrist on: one, or one for each slip that it splits into."""


METACARPAL: Final = "metacarpal"
"""Name of the hand's geom."""

# The colour-blind safe palette of Okabe and Ito 2008 ("Color Universal Design"), without its
# yellow, which is hardly visible on skin.
TENDON_COLOURS: Final = {
    "FDP": (0.835, 0.369, 0.000),
    "FDS": (0.902, 0.624, 0.000),
    "EIP": (0.337, 0.706, 0.914),
    "EDC": (0.000, 0.447, 0.698),
    "LUM": (0.000, 0.620, 0.451),
    "DI": (0.150, 0.150, 0.150),
    "PI": (0.800, 0.475, 0.655),
}
"""Red, green and blue of each tendon, 0 to 1."""

THINNEST_M: Final = 0.0007
"""Radius of a tendon without tension, m, chosen like the other sizes in this file."""
THICKEST_M: Final = 0.0016
"""Radius of a tendon at its largest tension, m."""

_BONE: Final = (0.94, 0.91, 0.83, 1.0)
_NAIL: Final = (0.98, 0.86, 0.84, 0.9)
_SKIN: Final = (0.90, 0.66, 0.55, 0.20)
_SKY: Final = ((0.98, 0.985, 0.99), (0.82, 0.86, 0.91))
# Group of geoms and sites that are hidden by default.
_HIDDEN: Final = 4
# Radii of each bone's shaft and of the head at its end, m.
_SHAFTS: Final = (0.0040, 0.0034, 0.0029, 0.0026)
_HEADS: Final = (0.0060, 0.0048, 0.0039, 0.0034)
# Gap between a bone and the head of the previous one, m.
_CARTILAGE: Final = 0.0015
_JOINTS: Final = ("MCP", "PIP", "DIP")


def route_names(tendon: str) -> list[str]:
    """Names of the spatial tendons that show a tendon, such as `FDS/course` and `FDS/course_2`."""
    more = [f"{tendon}/course_{i}" for i in range(2, len(_TENDON_ROUTES[tendon]) + 1)]
    return [f"{tendon}/course", *more]


def add_anatomy(spec: mujoco.MjSpec) -> None:
    """Add bones, tendons, a nail and a light background to a finger of `build_finger`."""
    top, bottom = _SKY
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=top,
        rgb2=bottom,
        width=256,
        height=1536,
    )
    spec.visual.headlight.ambient[:] = (0.45, 0.45, 0.45)
    spec.visual.headlight.diffuse[:] = (0.35, 0.35, 0.35)
    spec.visual.headlight.specular[:] = (0.1, 0.1, 0.1)
    # The lamp shines from above and in front, so that the finger has a bright and a dark side.
    spec.worldbody.add_light(
        name="lamp",
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        pos=[0.1, 0.0, 0.3],
        dir=[-0.3, 0.2, -1.0],
        diffuse=[0.4, 0.4, 0.4],
        specular=[0.1, 0.1, 0.1],
        castshadow=False,
    )
    # Cameras can follow only a body, so the hand's geom moves to a new body.
    plain = spec.geom(METACARPAL)
    shape: dict[str, Any] = {"fromto": plain.fromto.copy(), "size": plain.size.copy()}
    spec.delete(plain)
    hand = spec.worldbody.add_body(name=_HAND)
    capsule = mujoco.mjtGeom.mjGEOM_CAPSULE
    hand.add_geom(name=METACARPAL, type=capsule, mass=0.0, rgba=_SKIN, **shape)
    bodies = {_HAND: hand} | {name: spec.body(name) for name in PHALANGES}
    for name in PHALANGES:
        spec.geom(name).rgba = _SKIN
    # Each bone reaches from its joint to the next. The last bone ends inside the fingertip.
    spans = [(float(spec.geom(METACARPAL).fromto[0]), 0.0)]
    for length, head in zip(PHALANX_LENGTH_M, _HEADS, strict=False):
        spans.append((head + _CARTILAGE, length))
    spans[-1] = (spans[-1][0], PHALANX_LENGTH_M[-1] - 1.5 * _HEADS[-1])
    for i, (name, (start, end)) in enumerate(zip(bodies, spans, strict=True)):
        _add_bone(bodies[name], name, start, end, i)
    for i, joint in enumerate(_JOINTS):
        _add_back(bodies[list(bodies)[i]], joint, spans[i][1], _HEADS[i])
    bodies[PHALANGES[-1]].add_geom(
        name="nail",
        type=mujoco.mjtGeom.mjGEOM_ELLIPSOID,
        size=[0.0050, 0.0046, 0.0012],
        pos=[PHALANX_LENGTH_M[-1] - 0.0062, 0.0, 0.0060],
        euler=[0.0, 8.0, 0.0],
        mass=0.0,
        rgba=_NAIL,
    )
    for tendon in TENDONS:
        for name, course in zip(route_names(tendon), _TENDON_ROUTES[tendon], strict=True):
            _add_course(spec, bodies, name, course, TENDON_COLOURS[tendon])


def _add_bone(body: mujoco.MjsBody, name: str, start: float, end: float, i: int) -> None:
    shaft, head = _SHAFTS[i], _HEADS[i]
    shapes = {
        "shaft": (mujoco.mjtGeom.mjGEOM_CAPSULE, [shaft, 0.0, 0.0], [start, 0, 0, end, 0, 0]),
        "head": (mujoco.mjtGeom.mjGEOM_SPHERE, [head, 0.0, 0.0], None),
        "base": (mujoco.mjtGeom.mjGEOM_ELLIPSOID, [shaft, 1.45 * shaft, 1.35 * shaft], None),
    }
    places = {"head": end, "base": start + 0.5 * shaft}
    for part, (kind, size, fromto) in shapes.items():
        geom = body.add_geom(name=f"{name}/{part}", type=kind, size=size, mass=0.0, rgba=_BONE)
        if fromto is None:
            geom.pos = [places[part], 0.0, 0.0]
        else:
            geom.fromto = fromto


def _add_back(body: mujoco.MjsBody, joint: str, x: float, radius: float) -> None:
    """Add a hidden cylinder that the tendons at the back of a joint wrap around."""
    body.add_geom(
        name=joint,
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        size=[radius + THINNEST_M, 0.010, 0.0],
        pos=[x, 0.0, 0.0],
        quat=[1.0, 1.0, 0.0, 0.0],  # Turns the axis of the cylinder from z to y.
        mass=0.0,
        group=_HIDDEN,
    )
    body.add_site(name=f"{joint}/back", pos=[x, 0.0, 3.0 * radius], group=_HIDDEN)


def _add_course(
    spec: mujoco.MjSpec,
    bodies: dict[str, mujoco.MjsBody],
    name: str,
    course: TendonRoute,
    colour: tuple[float, float, float],
) -> None:
    tendon = spec.add_tendon(name=name, rgba=[*colour, 1.0], width=THINNEST_M)
    for i, stop in enumerate(course):
        if isinstance(stop, str):
            tendon.wrap_geom(stop, f"{stop}/back")
            continue
        body, *place = stop
        site = bodies[body].add_site(name=f"{name}/{i}", pos=1e-3 * np.array(place), group=_HIDDEN)
        tendon.wrap_site(site.name)


# Width of the narrowest frame with a legend, pixels. In narrower ones, names would be illegible.
_NARROWEST: Final = 240
_SMALLEST_FONT: Final = 9.0
# Height of the font, divided by the height of the frame. The legend stays above a raised finger.
_FONT: Final = 1.0 / 36.0
_INK: Final = (40, 40, 40)
_EMPTY: Final = (205, 210, 218)


def tendon_legend(frame: NDArray[np.uint8], pulled: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return a frame with each tendon's name, colour and tension on top, if it is wide enough.

    `pulled` has the length of each tendon's bar: its tension divided by its largest, 0 to 1, (7,).
    """
    height, width = frame.shape[:2]
    if width < _NARROWEST:
        return frame
    picture = Image.fromarray(frame)
    draw = ImageDraw.Draw(picture)
    size = max(_SMALLEST_FONT, _FONT * height)
    font = ImageFont.load_default(size)
    gap, column = 0.4 * size, width / len(TENDON_COLOURS)
    bar = column - 2.0 * gap
    top, bottom = gap + 1.2 * size, gap + 1.75 * size
    for i, (name, colour) in enumerate(TENDON_COLOURS.items()):
        left = i * column + gap
        filled = bar * float(np.clip(pulled[i], 0.0, 1.0))
        paint = tuple(round(255 * part) for part in colour)
        draw.text((left, 0.5 * gap), name, fill=_INK, font=font)
        draw.rectangle((left, top, left + bar, bottom), fill=_EMPTY)
        draw.rectangle((left, top, left + filled, bottom), fill=paint)
    return np.array(picture)


def polyline(
    points: NDArray[np.float64], radius: float, rgba: tuple[float, float, float, float]
) -> list[dict[str, Any]]:
    """Return markers of Gymnasium's viewers that connect points, m, (n, 3)."""
    markers: list[dict[str, Any]] = []
    for start, end in pairwise(points):
        along = end - start
        length = float(np.linalg.norm(along))
        if length <= 0.0:
            continue
        turn, axes = np.empty(4), np.empty(9)
        mujoco.mju_quatZ2Vec(turn, along / length)
        mujoco.mju_quat2Mat(axes, turn)
        markers.append(
            {
                "type": mujoco.mjtGeom.mjGEOM_CAPSULE,
                "pos": 0.5 * (start + end),
                "size": np.array([radius, radius, 0.5 * length]),
                "mat": axes,
                "rgba": np.array(rgba),
            }
        )
    return markers
