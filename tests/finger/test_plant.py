"""The simulated plant of a finger."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.finger.anatomy import JOINT_REST
from shapechanger.finger.parameters import NOMINAL
from shapechanger.finger.plant import FingerPlant
from shapechanger.finger.tensions import drive_of


def test_tensions_are_at_least_the_pretension() -> None:
    """The pretension holds from the first moment on."""
    parameters = NOMINAL.replace(least_tension=1.5)
    plant = FingerPlant(parameters, drive_of("tension", NOMINAL))
    rng = np.random.default_rng(0)
    senses = plant.place(JOINT_REST, rng)
    assert senses.tensions.min() == pytest.approx(1.5)
    for _ in range(10):
        senses = plant.act(np.full(7, -1.0), rng)
    assert senses.tensions.min() == pytest.approx(1.5)
