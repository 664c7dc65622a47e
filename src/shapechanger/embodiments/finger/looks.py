"""What the finger looks like: bones below the skin, and tendons where anatomy has them.

All of it is for display. It weighs nothing, touches nothing and pulls nothing: what moves the
finger are the fixed tendons of `shapechanger.embodiments.finger.model`.
"""

from __future__ import annotations

from typing import Final

import mujoco

from shapechanger.embodiments.finger.anatomy import PHALANGES, PHALANX_LENGTH_M, TENDONS
from shapechanger.embodiments.finger.courses import COURSES, HAND, Course, Through

__all__ = ["METACARPAL", "TENDON_COLOURS", "THICKEST_M", "THINNEST_M", "add_anatomy", "courses_of"]

METACARPAL: Final = "metacarpal"
"""Name of the geom that shows the hand."""

# The palette of Okabe and Ito 2008 ("Color Universal Design"), which those who cannot tell red from
# green can read; without its yellow, which is hardly seen on skin.
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
"""Radius that a tendon without tension is drawn with, m; chosen, as all numbers here."""
THICKEST_M: Final = 0.0016
"""The same at its largest tension."""

_BONE: Final = (0.94, 0.91, 0.83, 1.0)
_NAIL: Final = (0.98, 0.86, 0.84, 0.9)
_SKIN: Final = (0.90, 0.66, 0.55, 0.20)
_SKY: Final = ((0.98, 0.985, 0.99), (0.82, 0.86, 0.91))
# Neither geoms nor sites of this group are drawn unless a viewer is asked to.
_HIDDEN: Final = 4
# m. Of each bone its shaft's radius, and that of the head at its end, which a joint turns around.
_SHAFTS: Final = (0.0040, 0.0034, 0.0029, 0.0026)
_HEADS: Final = (0.0060, 0.0048, 0.0039, 0.0034)
# m. How far before its joint a bone begins, beside the head that it turns around.
_CARTILAGE: Final = 0.0015
_JOINTS: Final = ("MCP", "PIP", "DIP")


def courses_of(tendon: str) -> list[str]:
    """Names of the spatial tendons that show a tendon: `FDS/course`, `FDS/course_2`."""
    more = [f"{tendon}/course_{i}" for i in range(2, len(COURSES[tendon]) + 1)]
    return [f"{tendon}/course", *more]


def add_anatomy(spec: mujoco.MjSpec) -> None:
    """Show bones, tendons and a nail in a finger of `build_finger`, before a light background.

    Args:
        spec: The finger; it is changed.
    """
    _add_scene(spec)
    hand = _add_hand(spec)
    bodies = {HAND: hand} | {name: spec.body(name) for name in PHALANGES}
    for name in PHALANGES:
        spec.geom(name).rgba = _SKIN
    # From the joint that moves it to the next; the fingertip's flesh is before the last bone.
    metacarpal = spec.geom(METACARPAL)
    begin = float(metacarpal.fromto[0])
    spans = [(begin, 0.0)]
    for length, head in zip(PHALANX_LENGTH_M, _HEADS, strict=False):
        spans.append((head + _CARTILAGE, length))
    spans[-1] = (spans[-1][0], PHALANX_LENGTH_M[-1] - 1.5 * _HEADS[-1])
    for i, (name, (start, end)) in enumerate(zip(bodies, spans, strict=True)):
        _add_bone(bodies[name], name, start, end, i)
    for i, joint in enumerate(_JOINTS):
        _add_back(bodies[list(bodies)[i]], joint, spans[i][1], _HEADS[i])
    _add_nail(bodies[PHALANGES[-1]])
    for tendon in TENDONS:
        for name, course in zip(courses_of(tendon), COURSES[tendon], strict=True):
            _add_course(spec, bodies, name, course, TENDON_COLOURS[tendon])


def _add_scene(spec: mujoco.MjSpec) -> None:
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
    # From above and before the finger, so that it has a bright and a dark side.
    spec.worldbody.add_light(
        name="lamp",
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        pos=[0.1, 0.0, 0.3],
        dir=[-0.3, 0.2, -1.0],
        diffuse=[0.4, 0.4, 0.4],
        specular=[0.1, 0.1, 0.1],
        castshadow=False,
    )


def _add_hand(spec: mujoco.MjSpec) -> mujoco.MjsBody:
    """Make the hand a body, as pictures show what belongs to one."""
    plain = spec.geom(METACARPAL)
    fromto, size = plain.fromto.copy(), plain.size.copy()
    spec.delete(plain)
    hand = spec.worldbody.add_body(name=HAND)
    hand.add_geom(
        name=METACARPAL,
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        fromto=fromto,
        size=size,
        mass=0.0,
        rgba=_SKIN,
    )
    return hand


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


def _add_nail(body: mujoco.MjsBody) -> None:
    body.add_geom(
        name="nail",
        type=mujoco.mjtGeom.mjGEOM_ELLIPSOID,
        size=[0.0050, 0.0046, 0.0012],
        pos=[PHALANX_LENGTH_M[-1] - 0.0062, 0.0, 0.0060],
        euler=[0.0, 8.0, 0.0],
        mass=0.0,
        rgba=_NAIL,
    )


def _add_back(body: mujoco.MjsBody, joint: str, x: float, radius: float) -> None:
    """What the tendons at the back of a joint lie on: a cylinder that nobody sees."""
    body.add_geom(
        name=joint,
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        size=[radius + THINNEST_M, 0.010, 0.0],
        pos=[x, 0.0, 0.0],
        quat=[1.0, 1.0, 0.0, 0.0],  # Its axis from z to y.
        mass=0.0,
        group=_HIDDEN,
    )
    body.add_site(name=f"{joint}/back", pos=[x, 0.0, 3.0 * radius], group=_HIDDEN)


def _add_course(
    spec: mujoco.MjSpec,
    bodies: dict[str, mujoco.MjsBody],
    name: str,
    course: Course,
    colour: tuple[float, float, float],
) -> None:
    tendon = spec.add_tendon(name=name, rgba=[*colour, 1.0], width=THINNEST_M)
    for i, stop in enumerate(course):
        if isinstance(stop, Through):
            place = [1e-3 * stop.x, 1e-3 * stop.y, 1e-3 * stop.z]
            site = bodies[stop.body].add_site(name=f"{name}/{i}", pos=place, group=_HIDDEN)
            tendon.wrap_site(site.name)
        else:
            tendon.wrap_geom(stop.joint, f"{stop.joint}/back")
