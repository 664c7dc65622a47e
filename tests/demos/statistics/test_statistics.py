"""Statistics of a recording."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from shapechanger.demos.episodes import EpisodeWriter, drop, mark, read_episode
from shapechanger.demos.statistics import gaps_s, spread, summary
from tests.demos.episodes.making import header, recorded, step


def test_numbers_are_counted_in_bins() -> None:
    """Bounds fall into the outer bins, and 0 has its own bin."""
    found = spread([-1.0, -0.01, 0.0, 0.01, 0.02, 1.0, 1.0, math.nan], -1.0, 1.0)
    assert found is not None
    assert (found.counts[0], found.counts[10], found.counts[-1]) == (1, 4, 2)
    assert (found.total, found.missing) == (7, 1)
    assert (found.least, found.median, found.most) == (-1.0, 0.01, 1.0)


def test_without_bounds_the_range_is_that_of_the_numbers() -> None:
    """Equal numbers get a range around them; no finite number gives None."""
    found = spread([2.0, 4.0])
    assert found is not None
    assert (found.low, found.high) == (2.0, 4.0)
    alike = spread([3.0, 3.0])
    assert alike is not None
    assert (alike.low, alike.high, alike.total) == (2.5, 3.5, 2)
    assert spread([math.nan, math.inf]) is None


def test_summary_of_an_episode(tmp_path: Path) -> None:
    """Only kept steps count, and drivers are ordered by steps."""
    with EpisodeWriter.create(tmp_path, header(env="x/Car-v1"), spare_bytes=0) as writer:
        for number in range(10):
            writer.add(
                step(
                    number,
                    driver="expert" if number < 4 else "policy",
                    reward=1.0,
                    terms={"reward_collision": -10.0 * (number == 9)},
                    stop_reason="Slow." if number == 8 else "",
                )
            )
        writer.close("collision")
    drop(writer.path, 0, 2, "bad")
    mark(writer.path, 5, "here")
    found = summary(read_episode(writer.path))
    assert (found.what, found.steps, found.kept) == ("Car-v1", 10, 7)
    assert list(found.drivers.items()) == [("policy", 6), ("expert", 1)]
    assert (found.reward, found.collisions, found.stopped, found.marks) == (7.0, 1, 1, 1)
    assert found.seconds == pytest.approx(7 / 20)
    assert (found.outcome, found.closed) == ("collision", True)


def test_gaps_skip_dropped_steps(tmp_path: Path) -> None:
    """Dropped steps leave no long gap."""
    path = recorded(tmp_path, 6)
    drop(path, 2, 3, "bad")
    assert gaps_s(read_episode(path)) == pytest.approx([0.05, 0.05])
