"""Sensors are read in turn, and of several of one kind the most cautious reading counts."""

import itertools
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from shapechanger.contract.plan import SensorPlan
from shapechanger.errors import RobotError
from shapechanger.robot.guard import sensors as module
from shapechanger.robot.guard.sensors import Sensing, Sensors
from tests.robot.guard.plans import quick_car


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


def test_of_equal_readings_the_first_sensor_is_the_source() -> None:
    sensing = Sensing()
    for sensor in ("one", "two"):
        sensing.merge({"distance": 0.3}, sensor)
    assert sensing.sources == {"distance": "one"}


def test_no_sensor_hides_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each gets time and direction; one that fails, is slow or returns NaN is named."""
    now_ns, asked = 0, list[tuple[int, float]]()

    class Chip:
        def __init__(self, answer: Any, takes_ms: int) -> None:
            self.answer, self.takes_ms = answer, takes_ms

        def read(self, at_ns: int, direction: float) -> dict[str, float]:
            nonlocal now_ns
            now_ns += self.takes_ms * 1_000_000
            asked.append((at_ns, direction))
            if isinstance(self.answer, Exception):
                raise self.answer
            return self.answer

        def close(self) -> None: ...

    chips = {
        "dead": Chip(RobotError("It is dead."), 0),
        "dead and slow": Chip(OSError("gone"), 21),
        "broken": Chip({"distance": float("nan")}, 0),
        "slow": Chip({"distance": 1.0}, 21),
        "in time": Chip({"temperature": 40.0}, 20),
        "no echo": Chip({}, 0),
        "well": Chip({"distance": 0.5}, 0),
    }
    opened = {name: SimpleNamespace(open=lambda plan, _: chips[plan.name]) for name in chips}
    monkeypatch.setattr(module, "SENSORS", opened)
    plans = [SensorPlan(name, name, "distance") for name in chips]
    plans[4] = SensorPlan("in time", "in time", "temperature")
    hardware: Any = SimpleNamespace(clock=SimpleNamespace(now_ns=lambda: now_ns))
    sensing = Sensors(replace(quick_car(), sensors=tuple(plans)), hardware).read(5, -1.0)
    assert asked == [(5, -1.0)] * len(chips)
    assert sensing.failures == {
        "dead": "It is dead.",
        "dead and slow": "gone It took more than 20 ms to answer.",
        "broken": "It returned a value that is not finite.",
        "slow": "It took more than 20 ms to answer.",
    }
    assert sensing.slow == {"dead and slow", "slow"}
    assert sensing.silent == {"no echo"}
    assert sensing.quantities == {"distance": 0.5, "temperature": 40.0}
    assert sensing.sources == {"distance": "well", "temperature": "in time"}
