"""A finger that is driven and sensed."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.bodies.finger import NOMINAL, drive_of
from shapechanger.bodies.finger.anatomy import JOINT_REST
from shapechanger.envs.finger.plant import CONTROL_DT, FingerPlant


def test_no_tendon_pulls_less_than_its_least() -> None:
    """A rig's pretension is more than the nominal finger's, also from the first moment on."""
    parameters = NOMINAL.replace(least_tension=1.5)
    plant = FingerPlant(parameters, drive_of("tension", NOMINAL), CONTROL_DT)
    rng = np.random.default_rng(0)
    senses = plant.place(JOINT_REST, rng)
    assert senses.tensions.min() == pytest.approx(1.5)
    for _ in range(10):
        senses = plant.act(np.full(7, -1.0), rng)
    assert senses.tensions.min() == pytest.approx(1.5)
