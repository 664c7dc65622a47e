"""Vehicles in simulated worlds, in this process and without a network."""

from __future__ import annotations

from shapechanger.errors import MissingExtra

try:
    # Without MuJoCo, the bodies would name only one of the two extras.
    import mujoco  # noqa: F401  # pyright: ignore[reportUnusedImport]

    from shapechanger.vehicles.envs.env import VehicleEnv
    from shapechanger.vehicles.envs.ranges import RangesEnv
    from shapechanger.vehicles.envs.waypoints import WaypointEnv
except ModuleNotFoundError as error:
    raise MissingExtra(error.name or "mujoco", "sim,robot") from error

__all__ = ["RangesEnv", "VehicleEnv", "WaypointEnv"]
