"""A robot learns the same with any units of its actuators."""

from __future__ import annotations

from pathlib import Path

import pytest

from shapechanger.contract.env_ref import EnvRef
from shapechanger.transfer.learners.evaluation import Evaluation
from shapechanger.transfer.learners.presets import resolve_learner
from shapechanger.transfer.learners.sb3 import Sb3Learner
from shapechanger.transfer.learners.settings import Sb3Settings

_HOIST = """
<mujoco><worldbody><body name="mass">
  <joint name="lift" type="slide" axis="0 0 1" range="0 1" damping="5"/>
  <geom type="box" size=".1 .1 .1" mass="1.5"/></body></worldbody>
  <actuator><motor joint="lift" gear="{gear}" ctrlrange="-{reach} {reach}"/></actuator></mujoco>
"""
_STEPS = 32_768


def _curve(file: Path, gear: float, reach: float) -> list[Evaluation]:
    """Return the evaluations of a training with a motor of 30 to 32 N."""
    file.write_text(_HOIST.format(gear=gear, reach=reach))
    _, settings = resolve_learner("ppo-balance", {"eval_every": 8192})
    assert isinstance(settings, Sb3Settings)
    kwargs = {"path": str(file), "task": "tests.envs.own_robots:Hoist", "max_episode_steps": 1000}
    env, curve = EnvRef("shapechanger/OwnRobot-v1", kwargs), list[Evaluation]()
    Sb3Learner("ppo-balance", settings).train(env, _STEPS, 0, on_evaluation=curve.append)
    return curve


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_hoist_learns_the_same_in_newtons(tmp_path: Path) -> None:
    """If the units differ by a power of two, the learning curves are equal to the last bit."""
    share, newtons = (_curve(tmp_path / "hoist.xml", *each) for each in ((32, 1), (1, 32)))
    assert share == newtons
    assert share[0].mean_return < -450.0
    assert share[-1].mean_return > -400.0


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_hoist_of_30_newtons_learns(tmp_path: Path) -> None:
    """A hoist with a range of ±30 N learns like one with a range of ±1, from the same start.

    A factor of 30 changes roundings, so trainings with the same seed differ after 32,768 steps:
    their returns were -66 and -286.
    """
    for each in ((30, 1), (1, 30)):
        curve = _curve(tmp_path / "hoist.xml", *each)
        assert curve[0].mean_return < -450.0
        assert curve[-1].mean_return > -400.0
