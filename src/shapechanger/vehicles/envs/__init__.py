"""The driving task as Gymnasium envs: `VehicleEnv`, `RangesEnv` and `WaypointEnv`."""

from __future__ import annotations

from shapechanger.errors import needing_extra

with needing_extra("sim"):
    from shapechanger.vehicles.envs.ranges import RangesEnv
    from shapechanger.vehicles.envs.vehicle import VehicleEnv, WaypointEnv

__all__ = ["RangesEnv", "VehicleEnv", "WaypointEnv"]
