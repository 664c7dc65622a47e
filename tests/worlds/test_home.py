"""Default worlds of the vehicles."""

from __future__ import annotations

from shapechanger.bodies.vehicles import VEHICLES
from shapechanger.worlds.course import HOME
from shapechanger.worlds.layout import WORLDS


def test_every_vehicle_has_a_default_world() -> None:
    """`HOME` lists every vehicle with an existing world."""
    assert set(HOME) == set(VEHICLES)
    assert set(HOME.values()) == set(WORLDS)
