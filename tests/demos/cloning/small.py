"""Settings that learn the rendered corridor in seconds."""

from __future__ import annotations

from typing import Final

import numpy as np

from shapechanger.demos.cloning.pictures import Framing
from shapechanger.demos.cloning.policy import CameraPolicy
from shapechanger.demos.cloning.settings import CloneSettings
from tests.demos.cloning.corridor import Drive, drive

SIZE: Final = (24, 40)
"""Rows and columns."""

SMALL: Final = CloneSettings(
    framing=Framing(height=24, width=40, top=0.2),
    channels=(8, 16, 24),
    features=32,
    batch=32,
    fewest_steps=150,
    most_steps=150,
    warm_up=10,
    checks=5,
)


def demonstrations(n: int, seed: int, gain: float = 1.0) -> Drive:
    """Return demonstrations at the size of `SMALL`."""
    return drive(n, seed, size=SIZE, gain=gain)


def error(policy: CameraPolicy, test: Drive) -> float:
    """Return the mean absolute error of steering and throttle on test images."""
    return float(np.abs(policy.predict_many(test.pictures) - test.actions).mean())
