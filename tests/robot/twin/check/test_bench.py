"""What measures the outputs of a robot that is checked."""

from __future__ import annotations

import math

import pytest

from shapechanger.errors import RobotError
from shapechanger.robot.check.pins import lamps_of, probed_pin
from shapechanger.robot.twin.check.bench import Bench, ProbeWatcher
from tests.robot.check.held_pins import HeldPins, shipped


def test_a_probe_measures_the_stop(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is the time of the last edge; a pin that stays high never stops."""
    now_ns = 0
    monkeypatch.setattr("time.monotonic_ns", lambda: now_ns)
    pins = HeldPins()
    plan = shipped("car")
    watcher = ProbeWatcher(20, probed_pin(plan, 20), pins)
    wire = pins.factory.pin(20)
    now_ns = 1_000_000_000
    wire.drive_high()
    assert watcher.moves()
    assert math.isinf(watcher.rest_ms(now_ns))
    now_ns += 30_000_000
    wire.drive_low()
    assert watcher.moves()
    assert watcher.rest_ms(1_000_000_000) == 30.0
    assert watcher.rest_ms(2_000_000_000) == 0.0
    now_ns += 50_000_000
    assert not watcher.moves()
    (lamp, other) = lamps_of(plan)[:2]
    assert (watcher.sees(lamp), watcher.sees(other)) == (False, None)
    watcher.close()


def test_a_twin_takes_no_probe() -> None:
    """Its ledger has more."""
    with pytest.raises(RobotError, match="A twin needs no --probe"):
        Bench(shipped("car"), probe=20)
