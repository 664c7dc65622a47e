"""Switches of a model that would swallow an edit."""

from __future__ import annotations

from typing import Final

import mujoco

from shapechanger.errors import MorphologyError
from shapechanger.morphology.edits.edit import Edit
from shapechanger.morphology.edits.joints import JointRange
from shapechanger.morphology.edits.rigging import AddMotor
from shapechanger.morphology.edits.values import Damping, Friction, Gear, Gravity, Stiffness

_D: Final = mujoco.mjtDisableBit
_SWITCHED_OFF: Final[dict[type[Edit], tuple[mujoco.mjtDisableBit, str]]] = {
    Gravity: (_D.mjDSBL_GRAVITY, "gravity"),
    Damping: (_D.mjDSBL_DAMPER, "dampers"),
    Stiffness: (_D.mjDSBL_SPRING, "springs"),
    Gear: (_D.mjDSBL_ACTUATION, "actuators"),
    AddMotor: (_D.mjDSBL_ACTUATION, "actuators"),
    JointRange: (_D.mjDSBL_LIMIT, "limits of joints"),
    Friction: (_D.mjDSBL_CONTACT, "contacts"),
}


def require_effect(spec: mujoco.MjSpec, edit: Edit) -> None:
    """Refuse an edit of something that the model's options switch off.

    Args:
        spec: The specification.
        edit: The edit.

    Raises:
        MorphologyError: If the edit would change nothing.
    """
    flag, what = _SWITCHED_OFF.get(type(edit), (0, ""))
    if spec.option.disableflags & int(flag):
        raise MorphologyError(
            f"{type(edit).__name__} would change nothing, because the model switches {what} off: "
            "change its <flag> first."
        )
    override = spec.option.enableflags & int(mujoco.mjtEnableBit.mjENBL_OVERRIDE)
    if override and isinstance(edit, Friction):
        raise MorphologyError(
            "Friction would change nothing, because the model overrides the parameters of all "
            "contacts: change its <flag> first."
        )
