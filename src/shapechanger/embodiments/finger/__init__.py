"""A human index finger: anatomy, parameters, and its MuJoCo model."""

from __future__ import annotations

from shapechanger.embodiments.finger.anatomy import JOINTS, TENDONS
from shapechanger.embodiments.finger.drives import DRIVES, Drive, drive_of
from shapechanger.embodiments.finger.model import build_finger
from shapechanger.embodiments.finger.parameters import NOMINAL, FingerParameters

__all__ = [
    "DRIVES",
    "JOINTS",
    "NOMINAL",
    "TENDONS",
    "Drive",
    "FingerParameters",
    "build_finger",
    "drive_of",
]
