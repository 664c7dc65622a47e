"""Merging several sensors of one kind: the most cautious reading counts."""

import itertools

import pytest

from shapechanger.robot.guard.sensors import Sensing


@pytest.mark.parametrize(
    ("name", "values", "counts"),
    [
        ("bump", (1.0, 0.0), 1.0),
        ("collision", (0.0, 1.0), 1.0),
        ("stall", (1.0, 0.0), 1.0),
        ("temperature", (40.0, 90.0), 90.0),
        ("distance", (0.1, 4.0), 0.1),
        ("battery", (5.0, 7.4), 5.0),
        ("speed", (-0.01, 0.5), -0.01),
    ],
)
def test_the_order_of_sensors_does_not_matter(
    name: str, values: tuple[float, float], counts: float
) -> None:
    for pair in itertools.permutations(zip(values, ("one", "two"), strict=True)):
        sensing = Sensing()
        for value, sensor in pair:
            sensing.merge({name: value}, sensor)
        assert sensing.quantities == {name: counts}
        assert sensing.sources == {name: dict(zip(values, ("one", "two"), strict=True))[counts]}


def test_the_last_reading_of_other_quantities_counts() -> None:
    sensing = Sensing({"yaw_rate": 1.0}, {"yaw_rate": "one"})
    sensing.merge({"yaw_rate": 0.5}, "two")
    assert sensing == Sensing({"yaw_rate": 0.5}, {"yaw_rate": "two"})
