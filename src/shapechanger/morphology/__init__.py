"""Bodies that change shape: edits as values turn one MuJoCo model into another.

>>> import mujoco
>>> from shapechanger.morphology import Cut, Stretch, compile_body, to_json
>>> body = (Stretch("*shank*", 1.5), Cut("shank_4", 0.25))
>>> to_json(body)
'[{"edit":"stretch","body":"*shank*","factor":1.5},{"edit":"cut","body":"shank_4","keep":0.25}]'
"""

from __future__ import annotations

from shapechanger.errors import needing_extra

with needing_extra("sim"):
    import mujoco  # noqa: F401  # pyright: ignore[reportUnusedImport]

from shapechanger.morphology.edits import EDITS, Edit
from shapechanger.morphology.edits.limbs import (
    AddFreeJoint,
    AddLimb,
    AddMotor,
    AddSegment,
    Cut,
    Lock,
    Remove,
    Split,
)
from shapechanger.morphology.edits.places import (
    AddFloor,
    PlaceBody,
    PlaceGeom,
    Radius,
    StartHeight,
    Stretch,
)
from shapechanger.morphology.edits.values import (
    Damping,
    Density,
    Friction,
    Gear,
    Gravity,
    JointRange,
    Mass,
    Stiffness,
    TotalMass,
)
from shapechanger.morphology.families import (
    Body,
    as_body,
    compile_body,
    from_json,
    interpolate,
    reason_of,
    reshape,
    to_json,
)
from shapechanger.morphology.spec import name_elements

__all__ = [
    "EDITS",
    "AddFloor",
    "AddFreeJoint",
    "AddLimb",
    "AddMotor",
    "AddSegment",
    "Body",
    "Cut",
    "Damping",
    "Density",
    "Edit",
    "Friction",
    "Gear",
    "Gravity",
    "JointRange",
    "Lock",
    "Mass",
    "PlaceBody",
    "PlaceGeom",
    "Radius",
    "Remove",
    "Split",
    "StartHeight",
    "Stiffness",
    "Stretch",
    "TotalMass",
    "as_body",
    "compile_body",
    "from_json",
    "interpolate",
    "name_elements",
    "reason_of",
    "reshape",
    "to_json",
]
