"""The driving task as Gymnasium envs: `VehicleEnv`, `RangesEnv` and `WaypointEnv`."""

from __future__ import annotations

from shapechanger.errors import MissingExtra

try:
    from shapechanger.vehicles.envs.ranges import RangesEnv
    from shapechanger.vehicles.envs.vehicle import VehicleEnv, WaypointEnv
except ModuleNotFoundError as error:
    raise MissingExtra(error.name or "mujoco", "sim") from error

__all__ = ["RangesEnv", "VehicleEnv", "WaypointEnv"]
