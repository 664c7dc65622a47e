"""Where each vehicle is at home."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

__all__ = ["HOME"]

HOME: Final[Mapping[str, str]] = MappingProxyType(
    {"boat": "harbour", "car": "corridor", "tank": "corridor", "truck": "yard"}
)
"""Kind of place by the name of the vehicle."""
