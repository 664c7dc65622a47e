"""Studies of a suite: which runs they share, merging, and outcomes."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray

from shapechanger.contract.env_ref import EnvRef
from shapechanger.errors import ForeignStudy, OutputError
from shapechanger.transfer.executor import Executor, Job, OnProgress, Serial
from shapechanger.transfer.plan import Plan, TransferTask
from shapechanger.transfer.study import Study, make_plan, run_study
from shapechanger.transfer.suite import StudyOutcome, open_study_folder, study_outcome
from tests.demos.exchange.small import snapshot
from tests.transfer.lane import DRY, ICY, QUICK_CLONING, WET
from tests.transfer.report.studies import make_study
from tests.transfer.studies import curves

_KINDS = ("source", "random", "zero-action", "scratch", "zero-shot", "fine-tune")


class _Stopped(Exception):
    """Raised by an executor that only records its jobs."""


class _Recording(Serial):
    """Executor that records its jobs; if it `refuses`, it runs none of them."""

    def __init__(self, *, refuses: bool = False) -> None:
        self.names: list[str] = []
        self._refuses = refuses

    def run(self, jobs: Sequence[Job], on_progress: OnProgress) -> None:
        self.names += [job.name for job in jobs]
        if self._refuses:
            raise _Stopped
        super().run(jobs, on_progress)


def _plan(source: EnvRef, target: EnvRef, **more: Any) -> Plan:
    task = TransferTask(source, target)
    return make_plan(task, "cloning", QUICK_CLONING, **{"seeds": 2, **more})


def _study(plan: Plan) -> str:
    ends = (plan.task.source, plan.task.target)
    return "-to-".join(env.id.rpartition("/")[2].removesuffix("-v1") for env in ends)


def _run(plan: Plan, out: Path, executor: Executor) -> Study:
    return run_study(plan, open_study_folder(plan, out, _study(plan)), executor=executor)


def _names(*kinds: str) -> set[str]:
    return {
        f"{kind}-{index}" for kind in kinds for index in range(1 if kind == "zero-action" else 2)
    }


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a suite with the finished study Dry-to-Wet; tests use copies."""
    out = tmp_path_factory.mktemp("suite") / "suite"
    executor = _Recording()
    _run(_plan(DRY, WET), out, executor=executor)
    assert set(executor.names) == _names(*_KINDS)
    return out


@pytest.fixture
def out(first: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(first, tmp_path / "suite"))


def _requested(plan: Plan, out: Path) -> set[str]:
    executor = _Recording(refuses=True)
    with pytest.raises(_Stopped):
        _run(plan, out, executor=executor)
    return set(executor.names)


def test_runs_of_a_source_are_shared(out: Path) -> None:
    plan = _plan(DRY, ICY)
    assert _requested(plan, out) == _names(
        "random", "zero-action", "scratch", "zero-shot", "fine-tune"
    )
    there, here = out / "Dry-to-Wet", out / _study(plan)
    assert here == out / "Dry-to-Icy"
    for name in _names("source"):
        taken_over = snapshot(here / "runs" / name)
        assert taken_over == snapshot(there / "runs" / name)
        assert set(taken_over) == {"curve.jsonl", "policy.safetensors", "run.json"}
    shown = {path.name: path.read_bytes() for path in (here / "demonstrations").iterdir()}
    assert set(shown) == {"source-0.npz", "source-1.npz"}
    for name, content in shown.items():
        assert (there / "demonstrations" / name).read_bytes() == content


def test_runs_of_a_target_are_shared(out: Path) -> None:
    """Studies of one target share its runs; the numbers equal a separate study's."""
    plan, executor = _plan(ICY, WET), _Recording()
    parallel = _run(plan, out, executor=executor)
    assert set(executor.names) == _names("source", "zero-shot", "fine-tune")
    for name in _names("random", "zero-action", "scratch"):
        there, here = (out / study / "runs" / name for study in ("Dry-to-Wet", "Icy-to-Wet"))
        assert snapshot(here) == snapshot(there)
    alone = run_study(plan, out.parent / "alone", executor=Serial())
    assert curves(parallel) == curves(alone)
    assert parallel.summaries == alone.summaries


@pytest.mark.parametrize(
    "plan",
    [
        _plan(WET, DRY),  # Source and target are swapped.
        *(_plan(DRY, ICY, **more) for more in ({"seed": 1}, {"steps": 20}, {"source_steps": 40})),
        msgspec.structs.replace(_plan(DRY, ICY), versions={"torch": "0.1"}),
    ],
)
def test_studies_with_other_plans_share_nothing(out: Path, plan: Plan) -> None:
    assert _requested(plan, out) == _names(*_KINDS)


def test_a_study_with_more_seeds_keeps_its_finished_runs(out: Path) -> None:
    assert _requested(_plan(DRY, WET, seeds=3), out) == {
        f"{kind}-2" for kind in _KINDS if kind != "zero-action"
    }
    other = _requested(_plan(DRY, ICY, seeds=3), out)
    assert not other & _names("source")
    with pytest.raises(ForeignStudy, match="differs in seeds"):
        _requested(_plan(DRY, WET), out)


def test_partial_copies_are_removed(out: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs are copied atomically; parts of a copy are removed."""

    def full(theirs: Path, mine: Path) -> None:
        mine.mkdir(parents=True)
        for name in ("run.json", "policy.safetensors"):
            (mine / name).write_bytes((theirs / name).read_bytes()[:100])
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    plan, runs = _plan(DRY, ICY), out / "Dry-to-Icy" / "runs"
    with monkeypatch.context() as patch:
        patch.setattr(shutil, "copytree", full)
        with pytest.raises(OutputError, match="source-0: No space left"):
            _run(plan, out, executor=_Recording(refuses=True))
    assert not (runs / "source-0").exists()
    _requested(plan, out)
    assert sorted(path.name for path in runs.iterdir()) == ["source-0", "source-1"]
    assert snapshot(runs / "source-0") == snapshot(out / "Dry-to-Wet" / "runs" / "source-0")


# Rises to 1,000 in 10,240 steps, with an evaluation every 1,024 steps.
_STEADY = np.linspace(0.0, 1000.0, 11)


def _twice(means: NDArray[np.float64]) -> NDArray[np.float64]:
    return means + np.array([[-30.0], [30.0]])


def _crossing(
    fine_tune: NDArray[np.float64], scratch: NDArray[np.float64] = _STEADY, **more: Any
) -> StudyOutcome:
    study = make_study(scratch=_twice(scratch), fine_tune=_twice(fine_tune), **more)
    return study_outcome("Ant-to-BigAnt", study)


def test_a_crossing_is_found_along_a_line() -> None:
    found = _crossing(np.array([0.0, 500.0, 1500.0, *[900.0] * 8]))
    assert list(found.gains) == ["jumpstart", "total_reward_gain", "asymptotic_gain"]
    assert found.gains["jumpstart"].value is not None
    assert msgspec.structs.replace(found, gains={}) == StudyOutcome(
        "Ant-to-BigAnt",
        final=pytest.approx(1000.0),
        zero_shot=pytest.approx(400.0),
        arm_final=pytest.approx(900.0),
        scratch_steps=pytest.approx(10_240.0),
        arm_steps=pytest.approx(1536.0),
    )
    assert found.halves


@pytest.mark.parametrize(
    ("fine_tune", "steps", "halves"),
    [
        (np.full(11, 1200.0), 0.0, True),
        (np.full(11, 400.0), None, False),
        # With exactly half, `halves` depends on rounding; it is checked below.
        (np.array([*[0.0] * 5, *[1000.0] * 6]), pytest.approx(5120.0), None),
    ],
    ids=["at once", "never", "half"],
)
def test_halves_means_less_than_half_of_the_steps_of_scratch(
    fine_tune: NDArray[np.float64], steps: float | None, halves: bool | None
) -> None:
    found = _crossing(fine_tune)
    assert found.arm_steps == steps
    assert halves is None or found.halves is halves
    assert not StudyOutcome("a", 1.0, None, 1.0, 5120.0, 2560.0).halves
    assert StudyOutcome("a", 1.0, None, 1.0, 5120.0, 2559.9).halves


def test_fine_tune_may_be_left_out() -> None:
    """The first arm that learns on the target, or else zero-shot, is then compared with scratch."""
    found = study_outcome("Ant-to-BigAnt", make_study(arms=("scratch", "zero-shot")))
    assert found.arm == "zero-shot"
    assert found.arm_final == found.zero_shot == pytest.approx(400.0)
    arms = ("scratch", "zero-shot", "frozen-trunk")
    assert study_outcome("Ant-to-BigAnt", make_study(arms=arms)).arm == "frozen-trunk"
    assert list(found.gains) == ["jumpstart", "total_reward_gain", "asymptotic_gain"]


def test_incomplete_runs_are_not_shared(out: Path) -> None:
    (out / "Dry-to-Wet" / "runs" / "source-1" / "run.json").unlink()
    assert _requested(_plan(DRY, ICY), out) & _names("source") == {"source-1"}
