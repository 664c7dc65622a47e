"""Profiles: the hardware, limits and task of a robot as one TOML file."""

from __future__ import annotations

from shapechanger.robot.profile.load import (
    find_profile,
    load_profile,
    shipped_profiles,
    write_profile,
)
from shapechanger.robot.profile.profile import Profile, ResetStep
from shapechanger.robot.profile.read import read_profile

__all__ = [
    "Profile",
    "ResetStep",
    "find_profile",
    "load_profile",
    "read_profile",
    "shipped_profiles",
    "write_profile",
]
