"""Copying and moving whole limbs within a model.

MuJoCo attaches parts of one model to another, under a prefix. So a limb is attached from a copy of
the model, and then renamed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import mujoco

from shapechanger.morphology.elements import subtree

__all__ = ["graft_copy", "move_limb"]

# Begins no name that anybody writes.
_MARK: Final = "graft~"


def graft_copy(
    spec: mujoco.MjSpec, limb: mujoco.MjsBody, suffix: str, angle: float
) -> mujoco.MjsBody:
    """Add a copy of `limb` with its motors, turned by `angle` (rad) about its parent's z axis.

    Returns:
        The first body of the copy; each of its elements is called as the original's plus `suffix`.
    """
    frame = limb.parent.add_frame(quat=[math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle)])
    copy = _attach(spec, frame, limb.name, with_motors=True)
    _rename(copy, lambda name: name.removeprefix(_MARK) + suffix)
    for actuator in spec.actuators:
        if actuator.name.startswith(_MARK):
            actuator.name = actuator.name.removeprefix(_MARK) + suffix
            actuator.target = actuator.target.removeprefix(_MARK) + suffix
    return copy


def move_limb(spec: mujoco.MjSpec, limb: mujoco.MjsBody, parent: mujoco.MjsBody) -> mujoco.MjsBody:
    """Hang `limb` on another body at the same pose in its frame; its motors keep their places.

    Returns:
        The limb, which is another object now.
    """
    moved = _attach(spec, parent.add_frame(), limb.name, with_motors=False)
    # Actuators find their joint by name: under another name the old joints go without them.
    _rename(limb, lambda name: name + _MARK)
    spec.delete(limb)
    _rename(moved, lambda name: name.removeprefix(_MARK))
    return moved


def _attach(
    spec: mujoco.MjSpec, frame: mujoco.MjsFrame, limb_name: str, *, with_motors: bool
) -> mujoco.MjsBody:
    """Attach a copy of the limb to the frame, each of its names with the mark before it."""
    donor = spec.copy()
    unwanted = [donor.sensors, donor.tendons, donor.equalities, donor.pairs, donor.excludes]
    unwanted += [donor.keys, donor.numerics, donor.texts, donor.tuples]
    if not with_motors:
        unwanted.append(donor.actuators)
    for elements in unwanted:
        for element in list(elements):
            donor.delete(element)
    # Materials would come along as copies; the limb is to share those that are there.
    looks = {geom.name: geom.material for geom in donor.geoms}
    for geom in donor.geoms:
        geom.material = ""
    for element in [*donor.materials, *donor.textures]:
        donor.delete(element)
    attached = frame.attach_body(donor.body(limb_name), _MARK, "")
    for body in subtree(attached):
        for geom in body.geoms:
            geom.material = looks[geom.name.removeprefix(_MARK)]
    return attached


def _rename(limb: mujoco.MjsBody, renamed: Callable[[str], str]) -> None:
    """Rename a limb's bodies and what they hold."""
    for body in subtree(limb):
        body.name = renamed(body.name)
        for element in (*body.joints, *body.geoms, *body.sites, *body.cameras, *body.lights):
            element.name = renamed(element.name)
