"""Sensors are read in turn; if several measure a quantity, the most cautious reading is used."""

import itertools
from dataclasses import replace
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import pytest

from shapechanger.contract.plan import SensorPlan
from shapechanger.errors import RobotError
from shapechanger.robot.guard import sensors as module
from shapechanger.robot.guard.sensors import Sensing, Sensors
from tests.robot.guard.plans import quick_car


@pytest.mark.parametrize(
    ("name", "values", "counts"),
    [
        *((name, (1.0, 0.0), 1.0) for name in ("bump", "collision", "stall")),
        ("temperature", (40.0, 90.0), 90.0),
        ("distance", (0.1, 4.0), 0.1),
        ("battery", (5.0, 7.4), 5.0),
        ("speed", (-0.01, 0.5), -0.01),
    ],
)
def test_the_most_cautious_reading_is_used(
    name: str, values: tuple[float, float], counts: float
) -> None:
    """Of equal readings the first one is used; of a quantity without a rank, the last reading."""
    for pair in itertools.permutations(zip(values, ("one", "two"), strict=True)):
        sensing = Sensing()
        for value, sensor in (*pair, (counts, "three")):
            sensing.merge({name: value}, sensor)
        assert sensing == Sensing({name: counts}, {name: dict(pair)[counts]})
    sensing.merge({"yaw_rate": 1.0}, "one")
    sensing.merge({"yaw_rate": 0.5}, "two")
    assert (sensing.quantities["yaw_rate"], sensing.sources["yaw_rate"]) == (0.5, "two")


def test_no_sensor_hides_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sensors that fail, are slow or return NaN are reported, and all others are read."""
    now_ns, asked = 0, list[tuple[float, ...]]()

    def chip(answer: Any, takes_ms: int = 0) -> Mock:
        def read(*given: float) -> dict[str, float]:
            nonlocal now_ns
            now_ns += takes_ms * 1_000_000
            asked.append(given)
            if isinstance(answer, Exception):
                raise answer
            return answer

        return Mock(**{"read.side_effect": read})

    chips = {
        "dead": chip(RobotError("It is dead.")),
        "dead and slow": chip(OSError("gone"), 21),
        "broken": chip({"distance": float("nan")}),
        "slow": chip({"distance": 1.0}, 21),
        "in time": chip({"temperature": 40.0}, 20),
        "no echo": chip({}),
        "well": chip({"distance": 0.5}),
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
