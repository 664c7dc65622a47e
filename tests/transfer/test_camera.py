"""The learner of clones: refused envs, and the shipped clones as sources."""

from __future__ import annotations

import pytest

from shapechanger.contract.env_ref import EnvRef
from shapechanger.errors import StudyError
from shapechanger.transfer.learners import PolicyOrigin
from shapechanger.transfer.learners.presets import learner_settings
from shapechanger.transfer.plan import TransferTask
from shapechanger.transfer.study import make_plan
from shapechanger.vehicles.cloning import CloneLearner, CloningSettings
from shapechanger.vehicles.envs.demonstrators import CLONES
from tests.transfer.lane import LANE, TINY_CLONING
from tests.transfer.studies import BIG


@pytest.mark.parametrize("order", [1, -1])
def test_envs_without_a_demonstrator_are_refused(order: int) -> None:
    task = TransferTask(*(LANE, BIG)[::order])
    with pytest.raises(
        StudyError, match=r"InvertedPendulum-v1 has no camera and no demonstrator, and cloning"
    ):
        make_plan(task, "cloning", TINY_CLONING, seeds=2)


@pytest.mark.parametrize("vehicle", CLONES)
def test_the_clones_of_the_package_are_sources(vehicle: str) -> None:
    """Their cards name the env and the 12,000 demonstrated steps."""
    settings = learner_settings("cloning")
    assert isinstance(settings, CloningSettings)
    env = EnvRef(f"shapechanger/{vehicle.capitalize()}-v1", {"put_back": True})
    origin = CloneLearner("cloning", settings).origin(CLONES[vehicle])
    assert origin == PolicyOrigin(env, 12_000, {})
