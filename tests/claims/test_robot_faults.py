"""The robot stops in time after each fault, judged by the ledger of a twin."""

import contextlib
from collections.abc import Iterator

import pytest

from shapechanger.robot.twin.check.faults import FAULTS
from shapechanger.robot.twin.check.trial import Bench, run_trials
from tests.robot.witness import MARGIN_MS, Witness
from tests.robots import write_profile

pytestmark = [pytest.mark.realtime, pytest.mark.system]

TRIALS = 2
PILOT = "shapechanger.vehicles.remote.full_throttle"


@pytest.fixture(scope="module")
def guards_witness() -> Iterator[Witness]:
    """A witness of the delays of the guard, which switches the outputs."""
    with contextlib.closing(Witness("guard")) as made:
        yield made


@pytest.fixture(scope="module")
def daemons_witness() -> Iterator[Witness]:
    """A witness of the delays of the daemon, which passes commands to the guard."""
    with contextlib.closing(Witness("normal")) as made:
        yield made


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    """A robot for all faults, replaced when a fault ends it."""
    profile = write_profile(tmp_path_factory.mktemp("faults"))
    with contextlib.closing(Bench(profile, pilot=PILOT)) as made:
        yield made


@pytest.mark.parametrize("name", FAULTS)
def test_the_robot_stops(
    bench: Bench, guards_witness: Witness, daemons_witness: Witness, name: str
) -> None:
    """The stop is within the promised time, and the robot never drives without a fresh command."""
    drove = 0
    guards_witness.longest_ms()
    daemons_witness.longest_ms()
    for result in run_trials(bench, FAULTS[name], TRIALS):
        margin_ms = MARGIN_MS + guards_witness.longest_ms()
        drove += result.drove
        assert result.stopped_ms <= result.limit_ms + margin_ms, result
        # An output may be as late as a stop after the deadline of the last command, which begins
        # when the daemon reads the command.
        margin_ms += daemons_witness.longest_ms()
        late_ms = [(i.end_ns - i.start_ns) / 1e6 for i in result.unauthorised]
        assert sum(late_ms) <= margin_ms, result
    assert drove == TRIALS
