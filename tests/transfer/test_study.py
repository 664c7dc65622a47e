"""A study from planning to its result, interrupted, resumed and refused."""

from __future__ import annotations

import errno
import json
import os
import shutil
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import gymnasium as gym
import msgspec
import numpy as np
import pytest

from shapechanger.contract.env_ref import EnvRef, certify_shift
from shapechanger.errors import (
    CorruptStudy,
    EmptyShift,
    ForeignStudy,
    LayoutError,
    MapError,
    OutputError,
    SpaceMismatch,
    StudyError,
    UnknownName,
)
from shapechanger.files import read_json
from shapechanger.layout import Feature, Layout
from shapechanger.transfer.executor import Executor, Job, OnProgress, Serial
from shapechanger.transfer.plan import ARMS, TransferTask
from shapechanger.transfer.study import STUDY_FILE, Study, default_arms, inspect_task, run_study
from tests.demos.exchange.small import snapshot
from tests.transfer.studies import BIG, SMALL, TINY, TINY_NORMALISED, curves, tiny_plan


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Study, Path]:
    """A study that was not interrupted, and its folder."""
    out = tmp_path_factory.mktemp("finished") / "study"
    return run_study(tiny_plan(), out, executor=Serial(), command="test"), out


@pytest.fixture
def out(finished: tuple[Study, Path], tmp_path: Path) -> Path:
    return Path(shutil.copytree(finished[1], tmp_path / "study"))


def test_every_arm_and_seed_is_evaluated(finished: tuple[Study, Path]) -> None:
    study, _ = finished
    assert [run.run.name for run in study.runs] == [
        f"{kind}-{i}"
        for kind in ("source", "random", "zero-action", "scratch", "zero-shot", "fine-tune")
        for i in range(1 if kind == "zero-action" else 2)
    ]
    assert [e.steps for e in study.of("scratch")[0].curve] == [0, 32, 64, 96]
    assert set(study.summaries) == {"zero-shot", "fine-tune"}
    assert "pole: length" in study.shift


def test_zero_shot_is_where_fine_tuning_starts(finished: tuple[Study, Path]) -> None:
    """The mapped and the transplanted source policy have equal returns."""
    study, _ = finished
    for unchanged, tuned in zip(study.of("zero-shot"), study.of("fine-tune"), strict=True):
        assert unchanged.curve[0].mean_return == tuned.curve[0].mean_return
        assert unchanged.curve[0].mean_length == tuned.curve[0].mean_length


def test_incomplete_runs_are_repeated(finished: tuple[Study, Path], out: Path) -> None:
    (out / STUDY_FILE).unlink()
    runs = out / "runs"
    for name in ("scratch-1", "source-1", "fine-tune-1"):
        (runs / name / "run.json").unlink()
    (runs / "scratch-1" / "curve.jsonl").write_text("half a li")
    (runs / "source-0" / "policy.safetensors").unlink()
    kept = (runs / "scratch-0" / "run.json").stat().st_mtime_ns
    resumed = run_study(tiny_plan(), out, executor=Serial())
    assert curves(resumed) == curves(finished[0])
    assert resumed.summaries == finished[0].summaries
    assert (runs / "source-0" / "policy.safetensors").exists()
    assert (runs / "scratch-0" / "run.json").stat().st_mtime_ns == kept


def test_ants_of_different_spaces_can_be_studied(tmp_path: Path) -> None:
    short = {"max_episode_steps": 20}
    task = TransferTask(
        EnvRef("shapechanger/Ant-v1", short), EnvRef("shapechanger/ExtendedAnt-v1", short)
    )
    plan = tiny_plan(
        msgspec.structs.replace(TINY_NORMALISED, eval_episodes=1),
        task=task,
        rules={"foot_*/motor": "copy ankle_*/motor"},
        steps=32,
        source_steps=32,
    )
    study = run_study(plan, tmp_path / "study", executor=Serial())
    for unchanged, tuned in zip(study.of("zero-shot"), study.of("fine-tune"), strict=True):
        np.testing.assert_allclose(
            unchanged.curve[0].mean_return, tuned.curve[0].mean_return, rtol=0.05
        )
    assert "reward_forward" in study.of("scratch")[0].curve[-1].terms


def test_a_shift_that_changes_nothing_is_refused(tmp_path: Path) -> None:
    with pytest.raises(EmptyShift, match="nothing to transfer across"):
        run_study(tiny_plan(task=TransferTask(BIG, BIG)), tmp_path / "s", executor=Serial())
    assert not (tmp_path / "s").exists()


_SPARSE = msgspec.structs.replace(TINY, eval_every=96)
_NOT_PLANNED: list[tuple[dict[str, Any], type[Exception], str]] = [
    ({"task": TransferTask(SMALL, EnvRef("shapechanger/Ant-v1"))}, MapError, "cannot be mapped"),
    ({"task": TransferTask(EnvRef("shapechanger/BigAnd-v1"), BIG)}, UnknownName, "r/BigAnt-v1"),
    ({"task": TransferTask(EnvRef("CartPole-v1"), BIG)}, LayoutError, "no observation_layout"),
    (
        {"task": TransferTask(EnvRef(SMALL.id, {"colour": "red"}), BIG)},
        UnknownName,
        "No argument of InvertedPendulum matches 'colour'",
    ),
    *(
        ({name: steps}, StudyError, f"{steps} {which} steps is too small.*32")
        for name, which in (("steps", "target"), ("source_steps", "source"))
        for steps in (1, 31)
    ),
    # Source steps are by default half of the target steps, rounded up to whole updates.
    ({"settings": _SPARSE, "steps": 96}, StudyError, "64 source steps "),
    ({"seeds": 1}, StudyError, "at least 2 seeds"),
    # Generators would refuse these seeds, but only after hours of training.
    *(
        ({"seed": seed}, StudyError, "A seed must be a whole number from 0 to 4294967295, got ")
        for seed in (-1, 2**32, 2**64, 0.5, True, "3")
    ),
    ({"arms": ("scratch", "fine-tun")}, UnknownName, "'fine-tune'"),
    ({"arms": ("scratch", "fine-tune", "fine-tune")}, StudyError, "named once"),
    ({"arms": ("zero-shot", "fine-tune")}, StudyError, "compares scratch"),
    ({"measure": "reward_survived"}, UnknownName, "Did you mean 'reward_survive'"),
]


@pytest.mark.parametrize(("arguments", "kind", "message"), _NOT_PLANNED)
def test_wrong_arguments_are_refused_before_anything_is_trained(
    arguments: dict[str, Any], kind: type[Exception], message: str
) -> None:
    with pytest.raises(kind, match=message):
        tiny_plan(**arguments)


@pytest.mark.parametrize("differs", ["seed", "versions"])
def test_a_folder_of_another_study_is_refused(
    finished: tuple[Study, Path], out: Path, differs: str
) -> None:
    """The message names the differences; no file is overwritten."""
    changed: Any = {"seed": 1, "versions": {"mujoco": "0.1"}}[differs]
    other = msgspec.structs.replace(tiny_plan(), **{differs: changed})
    with pytest.raises(ForeignStudy, match=f"differs in {differs}"):
        run_study(other, out, executor=Serial())
    assert read_json(out / STUDY_FILE, Study, "") == finished[0]


def test_a_folder_with_other_files_is_refused(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("precious")
    with pytest.raises(ForeignStudy, match="holds other files"):
        run_study(tiny_plan(), tmp_path, executor=Serial())
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


class _Planned(Executor):
    """An executor that only records its jobs."""

    def run(self, jobs: Sequence[Job], on_progress: OnProgress) -> None:
        self.jobs = jobs


def test_runs_of_a_robot_wait_for_one_another(tmp_path: Path) -> None:
    """After a failed run, no other run moves the robot, on any executor."""
    plan, planned = msgspec.structs.replace(tiny_plan(), exclusive=True), _Planned()
    with pytest.raises(StudyError, match="are not in"):
        run_study(plan, tmp_path / "robot", executor=planned)
    names = [run.name for run in plan.runs()]
    assert [job.name for job in planned.jobs] == names
    assert all(before.name in job.after for before, job in pairwise(planned.jobs))
    assert {job.attempts for job in planned.jobs} == {1}


@pytest.mark.parametrize("how", ["another run's", "cut short", "empty"])
def test_a_wrong_result_of_a_run_is_refused(out: Path, how: str) -> None:
    path = out / "runs" / "scratch-0" / "run.json"
    if how == "another run's":
        shutil.copy(out / "runs" / "scratch-1" / "run.json", path)
    else:
        content = json.loads(path.read_text())
        content["curve"] = content["curve"][:2] if how == "cut short" else []
        path.write_text(json.dumps(content))
    with pytest.raises(CorruptStudy, match=r"does not hold the result of scratch-0: delete"):
        run_study(tiny_plan(), out, executor=Serial())


@pytest.mark.parametrize("name", ["plan.json", "runs/scratch-0/run.json"])
def test_a_corrupt_file_is_named_and_nothing_is_lost(out: Path, name: str) -> None:
    (out / name).write_text('{"not": "it"')
    before = snapshot(out)
    with pytest.raises(CorruptStudy, match=name.replace(".", r"\.")):
        run_study(tiny_plan(), out, executor=Serial())
    assert snapshot(out) == before


def test_a_full_disk_loses_nothing(
    finished: tuple[Study, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Finished runs are kept, and the study can be resumed."""
    out = tmp_path / "study"
    replace = Path.replace

    def full(path: Path, target: Path) -> Path:
        if path.parent.name == "scratch-1":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return replace(path, target)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", full)
        with pytest.raises(OutputError, match=r"policy\.safetensors: No space left"):
            run_study(tiny_plan(), out, executor=Serial())
    assert (out / "runs" / "scratch-0" / "run.json").exists()
    assert not (out / "runs" / "scratch-1" / "run.json").exists()
    assert curves(run_study(tiny_plan(), out, executor=Serial())) == curves(finished[0])


def test_evaluations_are_not_more_frequent_than_updates() -> None:
    with pytest.raises(StudyError, match="eval_every must be at least"):
        msgspec.structs.replace(TINY, eval_every=31)
    with pytest.raises(StudyError, match="at least one env"):
        msgspec.structs.replace(TINY, n_envs=0)


class Misnamed(gym.Env[Any, Any]):
    """An env whose layout does not fit its space."""

    def __init__(self, as_dict: bool = False) -> None:
        box = gym.spaces.Box(-1.0, 1.0, (3,), np.float64)
        self.observation_space = gym.spaces.Dict({"x": box}) if as_dict else box
        self.action_space = gym.spaces.Box(-1.0, 1.0, (1,), np.float32)
        self.observation_layout = Layout((Feature("y", "1"), Feature("z", "1")))
        self.action_layout = Layout((Feature("slider/motor", "1", -1.0, 1.0),))


@pytest.mark.parametrize("kwargs", [{}, {"as_dict": True}])
def test_a_layout_that_does_not_fit_its_space_is_refused(kwargs: dict[str, Any]) -> None:
    gym.register("tests/Misnamed-v0", Misnamed)
    try:
        task = TransferTask(EnvRef("tests/Misnamed-v0", kwargs), SMALL)
        with pytest.raises(SpaceMismatch, match=r"observation of tests/Misnamed.* has 2 numbers"):
            tiny_plan(task=task, rules={"slider/motor": "zero"})
    finally:
        del gym.registry["tests/Misnamed-v0"]


def test_an_argument_refused_by_a_foreign_env_is_named() -> None:
    with pytest.raises(StudyError, match=r"CartPole-v1 cannot be made with these opt.*'colour'"):
        EnvRef("CartPole-v1", {"colour": "red"}).make()


class Failing(Misnamed):
    """An env whose certificate fails in a rollout."""

    def certify_shift(self, source: Any, target: Any) -> str:
        raise TypeError("can't multiply sequence by non-int")


def test_an_env_that_fails_in_the_rollout_is_refused() -> None:
    """The message names both envs, because either can fail."""
    with pytest.raises(
        StudyError, match=r"Failing.* or .*Misnamed.* fails in a short rollout \(can"
    ):
        certify_shift(Failing(), Misnamed())


def test_each_env_is_made_once(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[str] = []
    make = EnvRef.make

    def counted(env: EnvRef, **more: Any) -> gym.Env[Any, Any]:
        made.append(env.id)
        return make(env, **more)

    monkeypatch.setattr(EnvRef, "make", counted)
    traits = inspect_task(TransferTask(SMALL, BIG))
    assert default_arms(traits) == ARMS
    tiny_plan(traits=traits)
    assert made == [SMALL.id, BIG.id]
    assert "pole" in traits.shift
