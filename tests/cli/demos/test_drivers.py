"""Drivers for recording: policies, experts, and unsuitable ones."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from shapechanger.demos.cloning.card import CloneCard
from shapechanger.demos.cloning.pictures import Framing, PolicyError
from shapechanger.demos.cloning.policy import CameraPolicy
from shapechanger.demos.drivers import Act, CorrectedPilot
from shapechanger.demos.pilots import corrected_pilot, pilot_of
from shapechanger.errors import DemosError
from shapechanger.layout import Feature, Layout
from shapechanger.vehicles.envs import RangesEnv
from shapechanger.vehicles.envs.drive import DriveEnv
from tests.demos.corridor_env import CorridorEnv, Shows


def clone(path: Path, **changes: Any) -> str:
    """Save an untrained policy for the state of the corridor, and return its path."""
    env = CorridorEnv("state")
    card = CloneCard(
        framing=Framing(),
        channels=(4,),
        features=8,
        eyes="none",
        nerves=(8,),
        action_layout=env.action_layout,
        state_layout=env.observation_layout,
        low=(-1.0, -1.0),
        high=(1.0, 1.0),
    )
    CameraPolicy.blank(msgspec.structs.replace(card, **changes), 0).save(path)
    return str(path)


@pytest.mark.parametrize("shows", ["state", "both"])
def test_a_policy_gets_its_part_of_the_observation(shows: Shows, tmp_path: Path) -> None:
    """A state alone, or from a Dict; the actions fit the env."""
    env = CorridorEnv(shows)
    pilot = pilot_of(env, clone(tmp_path / "policy.safetensors"), "", 0)
    pilot.begin()
    decision = pilot.decide(env.reset(seed=0)[0])
    assert decision.driver == "policy"
    assert decision.carried_out.shape == (2,)
    assert env.action_space.contains(decision.carried_out)
    np.testing.assert_array_equal(decision.carried_out, decision.meant)


def test_a_corrected_policy_uses_the_expert_of_the_env(tmp_path: Path) -> None:
    env = CorridorEnv("both")
    pilot = pilot_of(env, clone(tmp_path / "policy.safetensors"), "expert", 0)
    assert isinstance(pilot, CorrectedPilot)
    pilot.begin()
    assert pilot.decide(env.reset(seed=0)[0]).driver == "policy"


def _corrected(env: DriveEnv, change: Act, steps: int) -> tuple[CorrectedPilot, set[str]]:
    """Let the expert drive with changed actions, corrected by itself; return marks too."""
    expert, remarks = env.expert(), set[str]()
    pilot = corrected_pilot(env, lambda seen: change(expert(seen)), env.demonstrator(0))
    env.reset(options={"course": 3, "start": 3})
    pilot.begin()
    for _ in range(steps):
        decision = pilot.decide(None)
        env.step(decision.carried_out)
        remarks.add(decision.remark)
    return pilot, remarks


@pytest.mark.parametrize("share", [0.3, 0.6])
def test_a_slow_driver_is_not_corrected(share: float) -> None:
    """The car drives where the expert would, with a share of the throttle."""
    with closing(RangesEnv("car", put_back=True)) as env:
        pilot, _ = _corrected(env, lambda right: right * np.float32([1.0, share]), 300)
        assert env.world.progress_m > 4.0
    assert pilot.corrected <= 0.05 * pilot.steps


def test_danger_and_standing_are_corrected() -> None:
    with closing(RangesEnv("car", put_back=True)) as env:
        pilot, remarks = _corrected(env, lambda right: right * np.float32([0.0, 1.0]), 300)
        assert 0.05 * pilot.steps < pilot.corrected < pilot.steps
        assert pilot.takeovers > 0
        assert any("what is ahead" in remark or "is off by" in remark for remark in remarks)
        pilot, remarks = _corrected(env, lambda right: right * np.float32([1.0, 0.0]), 100)
        assert "the expert takes over: it stands still" in remarks
        assert env.world.progress_m > 0.2


def test_a_policy_with_other_inputs_is_refused(tmp_path: Path) -> None:
    other = Layout((Feature("way", "m"), Feature("heat", "K")))
    policy = clone(tmp_path / "other.safetensors", state_layout=other)
    with pytest.raises(PolicyError, match=r"heat.*battery"):
        pilot_of(CorridorEnv("both"), policy, "", 0)
    with pytest.raises(PolicyError, match=r"battery.*gets none"):
        pilot_of(CorridorEnv("picture"), clone(tmp_path / "state.safetensors"), "", 0)
    from shapechanger.vehicles.envs.demonstrators import CLONES

    with pytest.raises(DemosError, match="drives by images"):
        pilot_of(CorridorEnv("state"), str(CLONES["car"]), "", 0)
