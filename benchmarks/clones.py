"""The policies that come with the package, as drivers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.cloning.policy import CameraPolicy
from shapechanger.envs.vehicle.drivers import CLONES

_SIZE: Final = (120, 160, 3)


def find_clone(vehicle: str) -> CameraPolicy | None:
    """The policy that drives a vehicle; None while there is none."""
    path = CLONES.get(vehicle)
    return None if path is None or not path.exists() else CameraPolicy.load(path)


def sighted(policy: CameraPolicy) -> Callable[[Any], NDArray[np.float32]]:
    """Drives by the pictures of the env."""
    return policy.predict


def blind(policy: CameraPolicy) -> Callable[[Any], NDArray[np.float32]]:
    """Drives by black pictures, whatever the env sees."""
    always = policy.predict(np.zeros(_SIZE, np.uint8))  # What it does knows no yesterday.
    return lambda _: always
