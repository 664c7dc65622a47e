"""The camera policies that come with the package, one for each vehicle.

Each was cloned from ten minutes of its expert's driving; `clones/README.md` is their model card.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Final

__all__ = ["CLONES"]

_FOLDER: Final = Path(__file__).parent / "clones"

CLONES: Final[Mapping[str, Path]] = MappingProxyType(
    {vehicle: _FOLDER / f"{vehicle}.zip" for vehicle in ("boat", "car", "tank", "truck")}
)
"""File of the policy by the name of the vehicle; `CameraPolicy.load` reads it."""
