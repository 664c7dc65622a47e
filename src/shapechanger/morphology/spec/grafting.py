"""Copy and move limbs, geoms and sites within a model.

MuJoCo attaches parts of one model to another under a prefix. So a limb is attached from a copy of
the model and then renamed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

import mujoco

from shapechanger.morphology.spec.elements import require_free_name, subtree
from shapechanger.morphology.spec.explicit import resolve_frames
from shapechanger.morphology.spec.geometry import orientation

# Prefix that no name of a model has.
_MARK: Final = "graft~"
# Fields of geoms and sites that refer to assets.
_ASSETS: Final = ("material", "meshname", "hfieldname")
# Fields of a site and of a geom, except the name and the orientation.
_SITE_FIELDS: Final = ("type", "size", "pos", "fromto", "group", "rgba", "material")
_GEOM_FIELDS: Final = (
    *(*_SITE_FIELDS, "density", "mass", "typeinertia", "contype", "conaffinity", "condim"),
    *("priority", "friction", "adhesion", "surfacevel", "solmix", "solref", "solimp", "margin"),
    *("gap", "fluid_ellipsoid", "fluid_coefs"),
)


def graft_copy(
    spec: mujoco.MjSpec, limb: mujoco.MjsBody, suffix: str, angle: float
) -> mujoco.MjsBody:
    """Add a turned copy of a limb with its motors.

    Args:
        spec: Specification that contains it.
        limb: First body of the limb.
        suffix: Appended to the names of all copied elements.
        angle: Turn about the z axis of the limb's parent, rad.

    Returns:
        The first body of the copy.
    """
    frame = limb.parent.add_frame(quat=[math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle)])
    copy = _attach(spec, frame, limb.name, with_motors=True)
    resolve_frames(spec)
    _rename(copy, lambda name: name.removeprefix(_MARK) + suffix)
    for actuator in spec.actuators:
        if actuator.name.startswith(_MARK):
            actuator.name = actuator.name.removeprefix(_MARK) + suffix
            actuator.target = actuator.target.removeprefix(_MARK) + suffix
    return copy


def move_limb(spec: mujoco.MjSpec, limb: mujoco.MjsBody, parent: mujoco.MjsBody) -> mujoco.MjsBody:
    """Attach a limb to another body, at the same pose in its frame; its motors keep their order.

    Args:
        spec: Specification that contains it.
        limb: First body of the limb.
        parent: The body to attach it to.

    Returns:
        The limb, which is another object now.
    """
    moved = _attach(spec, parent.add_frame(), limb.name, with_motors=False)
    # Actuators find their joint by name: under another name the old joints go without them.
    _rename(limb, lambda name: name + _MARK)
    spec.delete(limb)
    _rename(moved, lambda name: name.removeprefix(_MARK))
    return moved


def copy_geom(
    spec: mujoco.MjSpec, geom: mujoco.MjsGeom, body: mujoco.MjsBody, name: str
) -> mujoco.MjsGeom:
    """Add a copy of a geom to another body, at the same pose in its frame.

    Args:
        spec: Specification that contains it.
        geom: The geom to copy.
        body: Body of the copy.
        name: Name of the copy.

    Raises:
        MorphologyError: If the name is taken.
    """
    require_free_name(spec, "geom", name)
    copy = body.add_geom(name=name, quat=orientation(spec, geom))
    for field in _GEOM_FIELDS:
        setattr(copy, field, getattr(geom, field))
    return copy


def move_point(
    spec: mujoco.MjSpec, point: mujoco.MjsSite | mujoco.MjsGeom, body: mujoco.MjsBody
) -> mujoco.MjsSite | mujoco.MjsGeom:
    """Move a site or geom to another body, to the same pose in its frame.

    Args:
        spec: Specification that contains it.
        point: The site or geom.
        body: Its new body.

    Returns:
        The site or geom, which is another object now.
    """
    name = point.name
    point.name = name + _MARK  # References are by name.
    if isinstance(point, mujoco.MjsGeom):
        moved = copy_geom(spec, point, body, name)
    else:
        moved = body.add_site(name=name, quat=orientation(spec, point))
        for field in _SITE_FIELDS:
            setattr(moved, field, getattr(point, field))
    spec.delete(point)
    return moved


def _attach(
    spec: mujoco.MjSpec, frame: mujoco.MjsFrame, limb_name: str, *, with_motors: bool
) -> mujoco.MjsBody:
    """Attach a copy of a limb to a frame, with all of its names prefixed by the mark."""
    donor = spec.copy()
    unwanted: list[Any] = [*donor.sensors, *donor.tendons, *donor.equalities, *donor.pairs]
    unwanted += [*donor.excludes, *donor.keys, *donor.numerics, *donor.texts, *donor.tuples]
    unwanted += [*donor.skins, *donor.flexes]
    if not with_motors:
        unwanted += donor.actuators
    for element in unwanted:
        donor.delete(element)
    # Attaching would copy the assets; the limb shall share the existing ones.
    shared: dict[tuple[type, str], dict[str, str]] = {}
    for element in (*donor.geoms, *donor.sites):
        assets = {field: getattr(element, field, "") for field in _ASSETS}
        named = {field: asset for field, asset in assets.items() if asset}
        shared[type(element), element.name] = named
        for field in named:
            setattr(element, field, "")
    for element in [*donor.materials, *donor.textures, *donor.meshes, *donor.hfields]:
        donor.delete(element)
    attached = frame.attach_body(donor.body(limb_name), _MARK, "")
    for body in subtree(attached):
        for element in (*body.geoms, *body.sites):
            for field, asset in shared[type(element), element.name.removeprefix(_MARK)].items():
                setattr(element, field, asset)
    return attached


def _rename(limb: mujoco.MjsBody, renamed: Callable[[str], str]) -> None:
    """Rename a limb's bodies and their elements."""
    for body in subtree(limb):
        body.name = renamed(body.name)
        for element in (*body.joints, *body.geoms, *body.sites, *body.cameras, *body.lights):
            element.name = renamed(element.name)
