"""The expert drives every vehicle fast and without collisions on held-out courses."""

from __future__ import annotations

from contextlib import closing

import pytest

from benchmarks.driving import DriveScore, drive
from shapechanger.vehicles.bodies import VEHICLES
from shapechanger.vehicles.courses.course import HELD_OUT
from shapechanger.vehicles.envs import VehicleEnv


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_the_expert_is_fast_and_safe(vehicle: str) -> None:
    """The mean speed from rest is at least 60 % of the top speed."""
    with closing(VehicleEnv(vehicle, image=False, put_back=True)) as env:
        pilot = env.expert()
        score = DriveScore.of([drive(env, pilot, course=c, metres=15.0) for c in HELD_OUT[:2]])
    assert score.reached == 1.0
    assert score.collisions == 0
    assert score.speed >= 0.6 * VEHICLES[vehicle].top_speed_mps
