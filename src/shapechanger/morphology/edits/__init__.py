"""The edits: each a value that changes a model."""

from __future__ import annotations

from shapechanger.morphology.edits.edit import Edit
from shapechanger.morphology.edits.joints import JointRange, Lock
from shapechanger.morphology.edits.limbs import AddLimb, AddSegment, Cut, Remove, Split
from shapechanger.morphology.edits.values import (
    Damping,
    Density,
    Friction,
    Gear,
    Gravity,
    Mass,
    Radius,
    StartHeight,
    Stiffness,
    Stretch,
)

__all__ = [
    "AddLimb",
    "AddSegment",
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
]
