"""Human index finger: anatomy, parameters, tendon drives and MuJoCo model."""

from __future__ import annotations

from shapechanger.bodies.finger.anatomy import JOINTS, TENDONS
from shapechanger.bodies.finger.model import build_finger
from shapechanger.bodies.finger.parameters import NOMINAL, CommandPath, FingerParameters
from shapechanger.bodies.finger.tensions import DRIVES, TendonDrive, drive_of

__all__ = [
    "DRIVES",
    "JOINTS",
    "NOMINAL",
    "TENDONS",
    "CommandPath",
    "FingerParameters",
    "TendonDrive",
    "build_finger",
    "drive_of",
]
