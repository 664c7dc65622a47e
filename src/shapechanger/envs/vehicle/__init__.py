"""Vehicles in simulated worlds, in this process and without a network."""

from __future__ import annotations

from shapechanger.errors import MissingExtra

try:
    # Without MuJoCo, the bodies would name only one of the two extras.
    import mujoco  # noqa: F401  # pyright: ignore[reportUnusedImport]

    from shapechanger.envs.vehicle.env import VehicleEnv
    from shapechanger.envs.vehicle.ranges import RangesEnv
    from shapechanger.envs.vehicle.waypoints import WaypointEnv
except ModuleNotFoundError as error:
    raise MissingExtra(error.name or "mujoco", "sim,robot") from error

__all__ = ["RangesEnv", "VehicleEnv", "WaypointEnv"]
