"""Bodies that change shape: a MuJoCo model in, edits as values, another model out.

>>> import mujoco
>>> from shapechanger.morphology import Cut, Stretch, compile_body, to_json
>>> body = (Stretch("*shank*", 1.5), Cut("shank_4", 0.25))
>>> to_json(body)
'[{"edit":"stretch","body":"*shank*","factor":1.5},{"edit":"cut","body":"shank_4","keep":0.25}]'
"""

from __future__ import annotations

from shapechanger.errors import MissingExtra

try:
    import mujoco  # noqa: F401  # pyright: ignore[reportUnusedImport]  # Said here, in words.
except ImportError as error:
    raise MissingExtra("mujoco", "sim") from error

from shapechanger.morphology.body import EDITS, Body, as_body, from_json, interpolate, to_json
from shapechanger.morphology.edits import (
    AddLimb,
    AddSegment,
    Cut,
    Damping,
    Density,
    Edit,
    Friction,
    Gear,
    Gravity,
    JointRange,
    Lock,
    Mass,
    Radius,
    Remove,
    Split,
    StartHeight,
    Stiffness,
    Stretch,
)
from shapechanger.morphology.reshape import compile_body, reshape
from shapechanger.morphology.spec import name_elements

__all__ = [
    "EDITS",
    "AddLimb",
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
    "Radius",
    "Remove",
    "Split",
    "StartHeight",
    "Stiffness",
    "Stretch",
    "as_body",
    "compile_body",
    "from_json",
    "interpolate",
    "name_elements",
    "reshape",
    "to_json",
]
