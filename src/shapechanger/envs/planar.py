"""Runners and a swimmer that move in a plane."""

from __future__ import annotations

import warnings
from typing import Final

import gymnasium as gym

from shapechanger.errors import MissingExtra

try:
    import mujoco
    from gymnasium.envs.mujoco.half_cheetah_v5 import HalfCheetahEnv as GymnasiumHalfCheetahEnv
    from gymnasium.envs.mujoco.hopper_v5 import HopperEnv as GymnasiumHopperEnv
    from gymnasium.envs.mujoco.swimmer_v5 import SwimmerEnv as GymnasiumSwimmerEnv
    from gymnasium.envs.mujoco.walker2d_v5 import Walker2dEnv as GymnasiumWalker2dEnv
except (ImportError, gym.error.DependencyNotInstalled) as error:
    raise MissingExtra("mujoco", "sim") from error

from shapechanger.embodiments.plain import HALF_CHEETAH, HOPPER, SWIMMER, WALKER2D
from shapechanger.envs.runner import HealthyRunner, Runner

__all__ = ["HalfCheetahEnv", "HopperEnv", "SwimmerEnv", "Walker2dEnv"]

# Where Gymnasium clips the velocities that Hopper and Walker2d see, m/s and rad/s.
_CLIPPED_AT: Final = 10.0


class HalfCheetahEnv(  # pyright: ignore[reportIncompatibleVariableOverride]
    Runner, GymnasiumHalfCheetahEnv
):
    """Gymnasium's `HalfCheetah-v5` with any body that edits make of it.

    Actions, observations, rewards and infos are those of `HalfCheetah-v5`. See `Runner` for the
    arguments, and for the start pose, which follows from the body.
    """

    family = HALF_CHEETAH

    def _initialize_simulation(self) -> tuple[mujoco.MjModel, mujoco.MjData]:
        with warnings.catch_warnings():
            # MuJoCo deprecates how Gymnasium's file says what the cheetah weighs; another way of
            # saying it would change the last bits.
            warnings.filterwarnings("ignore", message=".*settotalmass.*")
            return super()._initialize_simulation()


class HopperEnv(  # pyright: ignore[reportIncompatibleVariableOverride]
    HealthyRunner, GymnasiumHopperEnv
):
    """Gymnasium's `Hopper-v5` with any body that edits make of it.

    Actions, observations, rewards and infos are those of `Hopper-v5`. See `HealthyRunner` for the
    arguments, and for the start pose and the healthy heights, which follow from the body.
    """

    family = HOPPER
    velocity_limit = _CLIPPED_AT


class Walker2dEnv(  # pyright: ignore[reportIncompatibleVariableOverride]
    HealthyRunner, GymnasiumWalker2dEnv
):
    """Gymnasium's `Walker2d-v5` with any body that edits make of it.

    Actions, observations, rewards and infos are those of `Walker2d-v5`. See `HealthyRunner` for the
    arguments, and for the start pose and the healthy heights, which follow from the body.
    """

    family = WALKER2D
    velocity_limit = _CLIPPED_AT


class SwimmerEnv(  # pyright: ignore[reportIncompatibleVariableOverride]
    Runner, GymnasiumSwimmerEnv
):
    """Gymnasium's `Swimmer-v5` with any body that edits make of it.

    Actions, observations, rewards and infos are those of `Swimmer-v5`. It swims in the horizontal
    plane, and stands on nothing. See `Runner` for the arguments.
    """

    family = SWIMMER
    place_size = 2
