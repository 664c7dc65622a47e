"""Gravity and the start height of a trunk."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from shapechanger.errors import MorphologyError, UnknownName
from shapechanger.morphology import Gravity, StartHeight
from tests.morphology.models import ant, built, leg


def test_gravity_is_set() -> None:
    """All components are set, or interpolated for partial edits."""
    moon = Gravity((0.0, 0.0, -1.62))
    np.testing.assert_array_equal(built(leg(), moon).opt.gravity, [0.0, 0.0, -1.62])
    np.testing.assert_allclose(
        built(leg(), Gravity((2.0, 0.0, -9.81)).partly(0.5)).opt.gravity, [1.0, 0.0, -9.81]
    )
    np.testing.assert_array_equal(built(leg(), Gravity((0.0, 0.0, 0.0))).opt.gravity, np.zeros(3))


@pytest.mark.parametrize(
    ("vector", "message"),
    [
        ((0.0, 0.0, math.nan), "Gravity must be a tuple of three finite numbers"),
        ((0.0, -9.81), "Gravity must be a tuple of three finite numbers"),
        ((0.0, 0.0, -251.0), "Gravity is at most 250 m/s², got 251"),
        ((200.0, 0.0, -200.0), "Gravity is at most 250 m/s², got 282.8"),
    ],
)
def test_absurd_gravity_is_refused(vector: Any, message: str) -> None:
    """Gravity is limited to 250 m/s²."""
    with pytest.raises(MorphologyError, match=message):
        Gravity(vector)


def test_the_trunk_starts_higher() -> None:
    """Only the height changes."""
    model = built(leg(), StartHeight("trunk", 1.7))
    np.testing.assert_array_equal(model.body("trunk").pos, [0.0, 0.0, 1.7])
    assert model.qpos0[2] == 1.7
    assert built(leg(), StartHeight("trunk", 2.0).partly(0.5)).qpos0[2] == 1.5


def test_only_trunks_have_a_start_height() -> None:
    """The error lists the trunks."""
    with pytest.raises(UnknownName, match=r"No trunk matches 'aux_1'\..* There are: torso\."):
        built(ant(), StartHeight("aux_1", 1.0))


@pytest.mark.parametrize("height", [math.nan, math.inf, 1e300])
def test_heights_are_limited(height: float) -> None:
    """Heights beyond 100 m are refused."""
    with pytest.raises(MorphologyError, match="A start height is at most 100 m"):
        StartHeight("trunk", height)
