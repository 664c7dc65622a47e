"""Results and scores of drives in the driving benchmark."""

from contextlib import closing

import pytest

from benchmarks.driving import DriveResult, DriveScore, drive, poisson_interval
from shapechanger.vehicles.courses.course import HELD_OUT
from shapechanger.vehicles.envs import VehicleEnv


@pytest.mark.parametrize(
    ("count", "low", "high"),
    # E. S. Pearson, H. O. Hartley, "Biometrika Tables for Statisticians" 1 (1966), table 40: the
    # limits of a Poisson variable for 1 - 2a = 0.95.
    [(0, 0.0, 3.69), (1, 0.0253, 5.57), (10, 4.80, 18.39), (50, 37.11, 65.92)],
)
def test_poisson_intervals_agree_with_tables(count: int, low: float, high: float) -> None:
    assert poisson_interval(count) == pytest.approx((low, high), abs=0.006)


def test_scores_are_ratios_of_sums() -> None:
    drives = DriveResult(1, 30.0, 20.0, 0, True, 0.1), DriveResult(2, 10.0, 60.0, 2, False, 0.5)
    score = DriveScore.of(list(drives))
    assert (score.drives, score.collisions, score.reached) == (2, 2, 0.5)
    assert (score.standing, score.speed) == pytest.approx(((2.0 + 30.0) / 80.0, 0.5))
    assert (score.slowest, score.fastest) == pytest.approx((1.0 / 6.0, 1.5))
    assert score.per_100_m == pytest.approx(5.0)
    assert (score.low, score.high) == pytest.approx((0.242 / 0.4, 7.22 / 0.4), abs=0.02)


def test_a_drive_ends_at_its_distance() -> None:
    """The expert drives 5 m without collisions."""
    with closing(VehicleEnv("car", image=False, put_back=True)) as car:
        done = drive(car, car.expert(), course=HELD_OUT[0], metres=5.0)
    assert (done.reached, done.collisions, done.course) == (True, 0, HELD_OUT[0])
    assert 5.0 <= done.metres < 5.2
    assert 5.0 / 2.0 < done.seconds < 5.0
    assert done.speed == pytest.approx(done.metres / done.seconds)
    assert done.standing < 0.1
