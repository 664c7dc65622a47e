"""Several sensors of one kind: the one that calls for more care counts."""

import itertools

import pytest

from shapechanger.robot.guard.sensors import merge


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
    """A pressed bumper is not hidden by a free one, nor a near wall by a far one."""
    for pair in itertools.permutations(zip(values, ("one", "two"), strict=True)):
        quantities: dict[str, float] = {}
        sources: dict[str, str] = {}
        for value, sensor in pair:
            merge(quantities, sources, {name: value}, sensor)
        assert quantities == {name: counts}
        assert sources == {name: dict(zip(values, ("one", "two"), strict=True))[counts]}


def test_of_other_quantities_the_last_one_counts() -> None:
    """With its source."""
    quantities = {"yaw_rate": 1.0}
    sources = {"yaw_rate": "one"}
    merge(quantities, sources, {"yaw_rate": 0.5}, "two")
    assert (quantities, sources) == ({"yaw_rate": 0.5}, {"yaw_rate": "two"})
