"""Every vehicle has a home in which it can drive."""

from __future__ import annotations

from shapechanger.bodies.vehicles import VEHICLES
from shapechanger.worlds.course import HOME
from shapechanger.worlds.layout import WORLDS


def test_every_vehicle_is_at_home_somewhere() -> None:
    """The table grows with the fleet, and names worlds that there are."""
    assert set(HOME) == set(VEHICLES)
    assert set(HOME.values()) == set(WORLDS)
