"""Default worlds of the vehicles."""

from __future__ import annotations

from shapechanger.vehicles.bodies import VEHICLES
from shapechanger.vehicles.courses import WORLDS
from shapechanger.vehicles.courses.course import FLOODED, HOME


def test_every_vehicle_is_at_home_somewhere() -> None:
    """`HOME` lists every vehicle, and every world but the flooded corridor is a home."""
    assert set(HOME) == set(VEHICLES)
    assert set(HOME.values()) == set(WORLDS) - {FLOODED}
