"""Vehicles in simulated worlds, in this process and without a network."""

from __future__ import annotations

from shapechanger.errors import MissingExtra

try:
    from shapechanger.envs.vehicle.env import VehicleEnv
except ModuleNotFoundError as error:
    raise MissingExtra(error.name or "mujoco", "sim,robot") from error

__all__ = ["VehicleEnv"]
