"""The robot stops in time after each fault, judged by the ledger of a twin."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from shapechanger.cli.robot.trial import FAULTS, Trial
from shapechanger.twin.signals import Transition, read_ledger
from tests.robots import write_profile

pytestmark = [pytest.mark.realtime, pytest.mark.system]

TOLERANCE = 10.0
"""Factor on the promised time of a stop, for a busy machine."""

TRIALS = 2


@pytest.fixture(scope="module")
def trial(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Trial]:
    """A robot for all faults, replaced when a fault ends it."""
    with Trial(write_profile(tmp_path_factory.mktemp("faults"))) as made:
        yield made


@pytest.mark.parametrize("name", FAULTS)
def test_the_robot_stops(trial: Trial, name: str) -> None:
    """The stop is in time, and the robot never drives without a fresh command."""
    fault = FAULTS[name]
    drove = 0
    # Repeat trials in which the robot had stopped before the fault.
    for _ in range(2 * TRIALS):
        result = trial.run(fault)
        drove += result.drove
        assert result.stopped_ms <= TOLERANCE * result.limit_ms, result
        # Beyond the deadline of the last command an output may be as late as a stop may.
        late_ms = [(i.end_ns - i.start_ns) / 1e6 for i in result.unauthorised]
        assert sum(late_ms) <= (TOLERANCE - 1.0) * fault.within_ms, result
        if drove == TRIALS:
            break
    assert drove == TRIALS


def frozen(ledger: list[Transition], pins: tuple[int, ...]) -> dict[int, float]:
    """Return the final levels of pins whose process died."""
    gone = [line.pid for line in ledger if line.kind == "gone"]
    return {
        line.pin: line.duty
        for line in ledger
        if line.kind == "pin"
        and line.pin in pins
        and line.duty is not None
        and not line.hz
        and line.pid in gone
    }


def test_without_the_one_shot_pins_keep_their_level(tmp_path: Path) -> None:
    """The documented weakness: without processes and hardware protection, power stays on."""
    # Keep the robot after the trial, to inspect it.
    fault = replace(FAULTS["guard and supervisor killed"], then="goes on")
    with Trial(write_profile(tmp_path), one_shot=False) as trial:
        result = trial.run(fault)
        levels = frozen(read_ledger(trial.ledger_path), (22, 27))
    assert result.drove
    assert levels[22] in {0.0, 1.0}
    assert levels[27] == 0.0
    # Software PWM freezes at its present level: high is full power for ever.
    assert math.isinf(result.stopped_ms) == (levels[22] == 1.0)
