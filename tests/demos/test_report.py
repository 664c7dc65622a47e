"""Reports of a recording: statistics, the page, and actions drawn below images."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shapechanger.demos.episodes import (
    Drop,
    Episode,
    EpisodeMark,
    EpisodeWriter,
    Step,
    edit,
    read_episode,
)
from shapechanger.demos.jpeg import COLOURS, overlay
from shapechanger.demos.report import distributions, recording_html
from tests.demos.episodes.making import ACTIONS, header, recorded, step


def test_statistics_and_the_page_count_only_kept_steps(tmp_path: Path) -> None:
    speeds = [-1.0, -0.01, 0.0, 0.01, 0.02, 1.0, 1.0, 7.0]
    with EpisodeWriter.create(tmp_path, header(env="x/Car-v1"), spare_bytes=0) as writer:
        for number, speed in enumerate(speeds):
            writer.add(
                step(
                    number,
                    action=(speed, 0.3),
                    state=(1.0, (math.nan, math.inf, 2.0, 4.0)[number % 4]),
                    driver="expert" if number < 4 else "policy",
                    reward=1.0,
                    terms={"reward_collision": -10.0 * (number == 6)},
                )
            )
        writer.close("collision")
    edit(writer.path, Drop(7, 7, "bad"))
    edit(writer.path, EpisodeMark(5, "here"))
    recorded(tmp_path / "none", 0)
    episode = read_episode(writer.path)
    assert (episode.origin, episode.reward, episode.outcome) == ("Car-v1", 7.0, "collision")
    assert list(episode.drivers.items()) == [("expert", 4), ("policy", 3)]
    assert episode.seconds == pytest.approx(7 / 20)
    steering, throttle, distance, between = distributions([episode])
    assert steering.values.tolist() == speeds[:7]
    assert (throttle.feature.low, throttle.feature.high) == (-1.0, 1.0)
    assert (distance.values.tolist(), distance.missing) == ([2.0, 4.0, 2.0], 4)
    assert (between.feature.unit, between.values.mean()) == ("ms", 50.0)
    edit(writer.path, Drop(2, 3, "bad"))
    assert read_episode(writer.path).gaps_s == pytest.approx([0.05] * 3)  # The gap is left out.
    page = recording_html("name", [episode])
    for part in ("Car-v1", "7 of 8", "Collisions", "step 5: here", "4 without a value"):
        assert part in page
    # 0 has its own bin; values outside the range are in the outer ones.
    assert "-0.0476 to 0.0476: 4 steps, 57.1 %" in page
    assert "0.905 to 1: 2 steps, 28.6 %" in page
    assert "49.5 to 49.5 ms: 0 steps" in page


def episode_with(times_ns: Sequence[int | None], hz: float) -> Episode:
    steps = [step(n, captured_ns=ns, decided_ns=None, index=n) for n, ns in enumerate(times_ns)]
    return Episode(Path(), header(control_hz=hz), tuple(steps), (), (), closed=True, outcome="")


@settings(max_examples=50, deadline=None)
@given(st.floats(1.0, 100.0), st.floats(0.0, 0.2), st.lists(st.floats(31.0, 1e5), max_size=3))
def test_durations_leave_out_pauses(hz: float, spread_by: float, pauses_s: list[float]) -> None:
    rng = np.random.default_rng(1)
    periods_s = (1 + rng.uniform(-spread_by, spread_by, 40)) / hz
    parts = [periods_s[n * 10 : (n + 1) * 10] for n in range(len(pauses_s) + 1)]
    times_s: list[float] = [0.0]
    for part, pause_s in zip(parts, [*pauses_s, 0.0], strict=True):
        times_s += (times_s[-1] + np.cumsum(part)).tolist()
        times_s += [times_s[-1] + pause_s] if pause_s else []
    driven_s = sum(part.sum() for part in parts) + (len(pauses_s) + 1) / hz
    found = episode_with([round(at_s * 1e9) for at_s in times_s], hz)
    assert found.seconds == pytest.approx(driven_s, rel=1e-6)
    assert episode_with([None] * 8, hz).durations_s == (1 / hz,) * 8
    assert episode_with([], hz).durations_s == ()


@pytest.mark.parametrize("steering", [-1.0, 0.5])
def test_a_bar_shows_the_action_and_a_white_line_the_suggestion(steering: float) -> None:
    picture = np.full((30, 40, 3), 7, np.uint8)
    one = Step(action=(steering, 0.0), driver="person", wanted=(-0.5 * steering, -1.0))
    drawn = overlay(picture, one, ACTIONS)
    assert drawn.shape == (30 * 12 + 2 * 14, 480, 3)
    assert (drawn[: 30 * 12] == 7).all()
    bar = drawn[30 * 12 + 7]
    blue = (bar == COLOURS["person"]).all(axis=1)
    assert (blue[:235].any(), blue[245:].any()) == (steering < 0.0, steering > 0.0)
    assert blue.sum() == pytest.approx(240 * abs(steering), abs=3)
    white = np.argwhere((bar == 255).all(axis=1)).ravel()
    assert white.tolist() == pytest.approx([240 - 120 * steering] * 2, abs=2)
