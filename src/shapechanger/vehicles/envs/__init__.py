"""The driving task as Gymnasium envs: `VehicleEnv`, `RangesEnv` and `WaypointEnv`.

Each is imported on first use, so that none loads what another needs.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any, Final

from shapechanger.errors import MissingExtra

if TYPE_CHECKING:
    from shapechanger.vehicles.envs.ranges import RangesEnv
    from shapechanger.vehicles.envs.vehicle import VehicleEnv, WaypointEnv

try:
    import mujoco  # noqa: F401  # pyright: ignore[reportUnusedImport]
except ModuleNotFoundError as error:
    raise MissingExtra("mujoco", "sim") from error

__all__ = ["RangesEnv", "VehicleEnv", "WaypointEnv"]

_MODULES: Final = {"RangesEnv": "ranges", "VehicleEnv": "vehicle", "WaypointEnv": "vehicle"}


def __getattr__(name: str) -> Any:
    """Import an env on first use (PEP 562)."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_MODULES[name]}"), name)
