"""Two small robots, a task and a method of a user, in a folder that tests edit."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import msgspec

from shapechanger.contract.env_ref import EnvRef
from shapechanger.envs.catalogue import OWN_ROBOT
from shapechanger.transfer.executor import Serial
from shapechanger.transfer.plan import Plan, TransferTask
from shapechanger.transfer.study import Study, make_plan, run_study
from tests.transfer.studies import TINY

XML = """
<mujoco><worldbody><body name="load">
  <joint name="lift" type="slide" axis="0 0 1" range="0 1" damping="5"/>
  <geom type="box" size=".1 .1 .1" mass="{}"/>
</body></worldbody>
<actuator><motor joint="lift" gear="30" ctrlrange="-1 1"/></actuator></mujoco>
"""
TASK = """
import {name}_goal

class Hold:
    def reward(self, robot):
        return {{"near": -abs(robot["lift/position"] - {name}_goal.HEIGHT)}}
"""
METHOD = """
from shapechanger.transfer.methods import register
from shapechanger.transfer.methods.basic import FineTune

@register
class Warm(FineTune):
    name = "{name}-warm"
"""
_STEPS = dict.fromkeys(("n_steps", "batch_size", "steps", "eval_every"), 8)
ONE_UPDATE = msgspec.structs.replace(TINY, n_envs=1, net_arch=(4,), eval_episodes=1, **_STEPS)


def write_project(folder: Path, name: str) -> None:
    """Write two robots, and modules `name_...` of a task, its goal and a method."""
    (folder / "a.xml").write_text(XML.format(1.5))
    (folder / "b.xml").write_text(XML.format(2.5))
    (folder / f"{name}_task.py").write_text(TASK.format(name=name))
    (folder / f"{name}_goal.py").write_text("HEIGHT = 0.5\n")
    (folder / f"{name}_method.py").write_text(METHOD.format(name=name))


def forget(name: str) -> None:
    """Forget the modules of a project, as a new process would."""
    for module in [each for each in sys.modules if each.startswith(name)]:
        del sys.modules[module]


def task_of(name: str) -> TransferTask:
    one, other = (
        EnvRef(OWN_ROBOT, {"path": path, "task": f"{name}_task:Hold", "max_episode_steps": 5})
        for path in ("a.xml", "b.xml")
    )
    return TransferTask(one, other)


def plan_of(name: str, seeds: int = 2, **more: Any) -> Plan:
    arms = ("scratch", f"{name}_method:{name}-warm")
    given = {"seeds": seeds, "steps": 8, "source_steps": 8, "arms": arms, **more}
    return make_plan(given.pop("task", task_of(name)), "tiny", ONE_UPDATE, **given)


def study_of(plan: Plan, out: Path) -> Study:
    return run_study(plan, out, executor=Serial())
