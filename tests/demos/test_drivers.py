"""Drivers of recordings: experts, policies, and policies that an expert corrects."""

from __future__ import annotations

import math
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.demos.cloning.network import CameraPolicy
from shapechanger.demos.dataset import load_dataset
from shapechanger.demos.drivers import Act, Pilot, pilot_of, record_steps
from shapechanger.demos.episodes import Episode, episodes_of, read_episode
from shapechanger.demos.recording import RecordEpisodes
from shapechanger.errors import DemosError, PolicyError
from shapechanger.layout import Feature, Layout
from shapechanger.vehicles.envs import RangesEnv
from shapechanger.vehicles.envs.demonstrators import CLONES
from tests.demos.cloning.data import clone_card
from tests.demos.corridor_env import AlwaysForward, CorridorEnv, Shows

AWAY = np.array([-1.0, 0.5], np.float32)
RIGHT = np.array([0.0, 0.5], np.float32)  # What the expert of the corridor intends.


def recorded(
    folder: Path, act: Act | None, expert: AlwaysForward | None, steps: int = 25
) -> list[Episode]:
    """Record in the corridor, which takes at most 40 steps at half throttle."""
    with RecordEpisodes(CorridorEnv("state"), folder) as env:
        record_steps(env, Pilot(env, act, expert), steps, seed=5)
    return [read_episode(path) for path in episodes_of(folder)]


def test_an_expert_is_recorded_with_its_intention(tmp_path: Path) -> None:
    episodes = recorded(tmp_path, None, AlwaysForward(), 50)
    assert sum(len(episode.steps) for episode in episodes) == 50
    assert [episode.header.seed for episode in episodes] == [5, 6]
    first = episodes[0].steps[0]
    assert (first.action, first.applied, first.driver) == ((0.0, 0.5), (0.25, 0.25), "expert")
    assert episodes[0].outcome == "collision"
    assert all(episode.closed for episode in episodes)


def test_only_corrections_are_learned_from(tmp_path: Path) -> None:
    (episode,) = recorded(tmp_path, lambda seen: AWAY, AlwaysForward())
    assert [s.driver for s in episode.steps] == ["policy"] * 2 + ["expert"] * 23
    before, after = episode.steps[1:3]
    assert (before.action, before.wanted) == ((-1.0, 0.5), None)
    # While it corrects a policy, the expert makes no mistakes.
    assert (after.action, after.wanted, after.applied) == ((0.0, 0.5), (-1.0, 0.5), (0.0, 0.25))
    assert [mark.step for mark in episode.marks] == [2]
    assert len(load_dataset(tmp_path)) == 23
    assert len(load_dataset(tmp_path, drivers=("policy",))) == 2


class Corrected:
    """A policy whose actions are given, and an expert that corrects it; it may touch something."""

    def __init__(self, right: np.ndarray[Any, Any] = RIGHT) -> None:
        env: Any = CorridorEnv()
        self.world = env.world = SimpleNamespace(
            inputs=lambda: SimpleNamespace(speed=1.0),
            distance_m=lambda: math.inf,
            placed=0,
            touches=False,
        )
        expert = SimpleNamespace(begin=lambda: None, act=lambda: (right, right))
        self.pilot = Pilot(env, lambda seen: seen, expert)

    def decide(self, wanted: Any, *, danger: bool = False) -> tuple[str, str]:
        """Return the first letter of the driver, and the remark."""
        self.world.touches = danger
        _, decided, remark = self.pilot.decide(np.array(wanted, np.float32))
        return decided.driver[0], remark


@pytest.mark.parametrize(
    ("gaps", "dangers", "drivers"),
    [
        ([0.9, 0.9, 0.0, 0.9, 0.9, 0.9], (), "pppppe"),  # A difference must last.
        ([0.9] * 3 + [0.1] * 9 + [0.4] + [0.1] * 11, (), "pp" + 20 * "e" + "pp"),
        ([0.0] * 16, (1, 3), "p" + 12 * "e" + "ppp"),  # Danger needs no time.
    ],
)
def test_when_the_expert_takes_over(
    gaps: list[float], dangers: tuple[int, ...], drivers: str
) -> None:
    """Steps last 0.1 s: the expert takes over after 0.3 s, and the policy drives on after 1 s."""
    one = Corrected()
    steps = enumerate(gaps)
    found = [one.decide(RIGHT + np.array([gap, 0.0]), danger=n in dangers) for n, gap in steps]
    assert "".join(driver for driver, _ in found) == drivers


def test_the_driver_changes_for_a_reason() -> None:
    one = Corrected()
    remarks = [one.decide(RIGHT + np.float32([0.8, 0.0]))[1] for _ in range(4)]
    assert remarks == ["", "", "the expert takes over: the policy is off by 0.8", ""]
    remarks = [one.decide(RIGHT)[1] for _ in range(11)]
    assert [text for text in remarks if text] == ["the policy drives on"]
    assert (one.pilot.steps, one.pilot.corrected, one.pilot.takeovers) == (15, 11, 1)


@given(right=st.floats(-1.0, 1.0, width=32), share=st.floats(0.0, 1.0, width=32))
def test_a_policy_slower_than_the_expert_is_not_corrected(right: float, share: float) -> None:
    one, slow = Corrected(np.array([0.0, right], np.float32)), (0.1, share * right)
    assert not any(one.decide(slow)[1] for _ in range(10))
    one.decide(slow, danger=True)
    assert [one.decide(slow)[1] for _ in range(10)][-1] == "the policy drives on"


@pytest.mark.parametrize("wanted", [(0.9, 0.5), (0.0, 1.0 + 0.2), (0.0, -0.7)])
def test_driving_faster_backward_or_aside_is_corrected(
    wanted: tuple[float, float],
) -> None:
    one = Corrected()
    assert "the policy is off by" in [one.decide(wanted)[1] for _ in range(3)][-1]


def clone(path: Path, observation: Layout | None = None) -> str:
    env = CorridorEnv("state")
    net = {"eyes": "none", "nerves": (8,), "low": (-1.0, -1.0), "high": (1.0, 1.0)}
    card = clone_card(env.action_layout, observation or env.observation_layout, **net)
    CameraPolicy.blank(card, 0).save(path)
    return str(path)


@pytest.mark.parametrize("shows", ["state", "both"])
@pytest.mark.parametrize("corrected_by", ["", "expert"])
def test_a_policy_gets_its_part_of_the_observation(
    shows: Shows, corrected_by: str, tmp_path: Path
) -> None:
    """The state may be the whole observation, or a part of a Dict."""
    env = CorridorEnv(shows)
    pilot = pilot_of(env, clone(tmp_path / "policy.safetensors"), corrected_by, 0)
    pilot.begin()
    action, decided, _ = pilot.decide(env.reset(seed=0)[0])
    assert decided.driver == "policy"
    assert env.action_space.contains(action)
    assert decided.action == tuple(action.tolist())


@pytest.mark.parametrize(
    ("factors", "steps"), [((1.0, 0.3), 300), ((0.0, 1.0), 300), ((1.0, 0.0), 100)]
)
def test_danger_and_standing_are_corrected_and_slowness_is_not(
    factors: tuple[float, float], steps: int
) -> None:
    """A car is driven by a share of its expert's steering and throttle, corrected by the expert."""
    with closing(RangesEnv("car", put_back=True)) as env:
        expert, remarks = env.expert(), set[str]()
        pilot = Pilot(env, lambda seen: expert(seen) * np.float32(factors), env.demonstrator(0))
        env.reset(options={"course": 3, "start": 3})
        pilot.begin()
        for _ in range(steps):
            action, _, remark = pilot.decide(None)
            env.step(action)
            remarks.add(remark)
        progress_m = env.world.progress_m
    share = pilot.corrected / pilot.steps
    if factors == (1.0, 0.3):
        assert progress_m > 4.0
        assert share <= 0.05
    elif factors == (1.0, 0.0):
        assert "the expert takes over: it stands still" in remarks
        assert progress_m > 0.2
    else:
        assert 0.05 < share < 1.0
        assert pilot.takeovers > 0
        assert any("what is ahead" in remark or "is off by" in remark for remark in remarks)


def test_a_policy_with_other_inputs_is_refused(tmp_path: Path) -> None:
    other = Layout((Feature("way", "m"), Feature("heat", "K")))
    policy = clone(tmp_path / "other.safetensors", other)
    with pytest.raises(PolicyError, match=r"heat.*battery"):
        pilot_of(CorridorEnv("both"), policy, "", 0)
    with pytest.raises(PolicyError, match=r"battery.*gets none"):
        pilot_of(CorridorEnv("picture"), clone(tmp_path / "state.safetensors"), "", 0)
    with pytest.raises(DemosError, match="drives by images"):
        pilot_of(CorridorEnv("state"), str(CLONES["car"]), "", 0)
