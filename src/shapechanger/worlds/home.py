"""Where each vehicle is at home, and where it cannot be."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from shapechanger.errors import WorldError

__all__ = ["HOME", "require_element"]

HOME: Final[Mapping[str, str]] = MappingProxyType(
    {"boat": "harbour", "car": "corridor", "tank": "corridor", "truck": "yard"}
)
"""Kind of place by the name of the vehicle."""


def require_element(vehicle: str, *, floats: bool, world: str) -> None:
    """Refuse a place of the wrong element: who floats needs water, and nobody else drives on it.

    Args:
        vehicle: Name of the vehicle.
        floats: Whether it floats.
        world: Kind of place.

    Raises:
        WorldError: If the vehicle cannot drive there.
    """
    if floats != (world == HOME["boat"]):
        what = "floats" if floats else "does not float"
        raise WorldError(f"A {vehicle} {what}: it cannot drive in a {world}.")
