"""Shipped camera policies as drivers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.cloning.network import CameraPolicy
from shapechanger.policy import load_policy
from shapechanger.vehicles.envs.demonstrators import CLONES

_SIZE: Final = (120, 160, 3)


def find_clone(vehicle: str) -> CameraPolicy | None:
    """Return the shipped policy of a vehicle; None if none ships."""
    path = CLONES.get(vehicle)
    return None if path is None or not path.exists() else load_policy(path)


def sighted(policy: CameraPolicy) -> Callable[[Any], NDArray[np.float32]]:
    """Return a driver that acts on the images of the env."""
    return policy.predict


def blind(policy: CameraPolicy) -> Callable[[Any], NDArray[np.float32]]:
    """Return a driver that acts on black images, regardless of the env's."""
    always = policy.predict(np.zeros(_SIZE, np.uint8))  # The policy has no memory.
    return lambda _: always
