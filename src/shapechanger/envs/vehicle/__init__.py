"""Vehicles in simulated worlds, in this process and without a network."""

from __future__ import annotations

from shapechanger.envs.vehicle.env import VehicleEnv

__all__ = ["VehicleEnv"]
