"""Studies of clones: shared demonstrations, budgets, resuming, and given policies."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from shapechanger.contract.env_ref import EnvRef
from shapechanger.demos.cloning.network import CameraPolicy
from shapechanger.errors import PolicyError, SpaceMismatch, StudyError
from shapechanger.policy import load_policy, save_policy
from shapechanger.transfer.executor import Serial
from shapechanger.transfer.learners import SharedFile
from shapechanger.transfer.learners.evaluation import Evaluation
from shapechanger.transfer.learners.presets import LEARNERS
from shapechanger.transfer.learners.sb3 import Sb3Learner
from shapechanger.transfer.metrics.measures import Summary, summarise
from shapechanger.transfer.plan import ARMS, Plan, Run, TransferTask
from shapechanger.transfer.study import STUDY_FILE, Study, make_plan, run_study
from shapechanger.vehicles import cloning
from shapechanger.vehicles.cloning import CloneLearner, CloningSettings, record_demonstrations
from shapechanger.vehicles.envs.demonstrators import CLONES
from tests.transfer.lane import DRY, HELD_OUT, ICY, LANE, QUICK_CLONING, SLIPPERY, TINY_CLONING, WET
from tests.transfer.studies import BIG, SMALL, TINY, tiny_plan

_FRAMING = TINY_CLONING.clone.framing
_LEARNER = CloneLearner("cloning", TINY_CLONING)


def _plan(*more: str) -> Plan:
    task = TransferTask(LANE, SLIPPERY)
    return make_plan(task, "cloning", TINY_CLONING, seeds=2, arms=(*ARMS, *more))


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Study, Path]:
    """A study that was not interrupted, and its folder."""
    out = tmp_path_factory.mktemp("cloned") / "study"
    return run_study(_plan(), out, executor=Serial()), out


def test_demonstrations_pair_images_with_intended_actions() -> None:
    shown = record_demonstrations(LANE, 150, 20, 3, _FRAMING)
    assert shown.pictures is not None
    assert shown.pictures.shape == (150, 12, 20, 3)
    assert shown.episodes == (20,) * 7 + (10,)
    bright = shown.pictures[:, 6, :, 0].argmax(axis=1)
    left = bright < 8  # The place is right of the middle, so the action must go left.
    right = bright > 9
    assert left.any()
    assert right.any()
    assert (shown.actions[left, 0] < 0.0).all()
    assert (shown.actions[right, 0] > 0.0).all()


def test_fewer_demonstrations_are_the_first_of_more() -> None:
    more, fewer = (record_demonstrations(LANE, steps, 20, 3, _FRAMING) for steps in (50, 30))
    first = more.part(np.arange(50) < 30)
    np.testing.assert_array_equal(first.pictures, fewer.pictures)
    np.testing.assert_array_equal(first.actions, fewer.actions)
    assert first.episodes == fewer.episodes == (20, 10)
    other = record_demonstrations(LANE, 30, 20, 4, _FRAMING)
    assert not np.array_equal(other.actions, fewer.actions)


def _cloned(
    folder: Path, steps: int = 120, *, only_last: bool = False, start: CameraPolicy | None = None
) -> tuple[CameraPolicy, list[Evaluation]]:
    found: list[Evaluation] = []
    policy = _LEARNER.train(
        LANE,
        steps,
        5,
        demonstrations=SharedFile(folder / "shown.npz", 6),
        start=start,
        only_last=only_last,
        on_evaluation=found.append,
    )
    return policy, found


def test_a_clone_improves_with_its_budget(tmp_path: Path) -> None:
    """There is an evaluation per budget, and the last one is better than the first."""
    policy, found = _cloned(tmp_path)
    assert [one.steps for one in found] == [0, 30, 60, 120]
    assert found[-1].mean_return > found[0].mean_return + 2.0
    assert set(found[-1].terms) == {"reward_middle", "reward_speed"}
    assert _LEARNER.evaluate(LANE, policy).mean_return == found[-1].mean_return


def test_rehearsal_starts_from_the_source_and_learns_from_both(
    finished: tuple[Study, Path], tmp_path: Path
) -> None:
    """Rehearsal is fine-tuning with the recorded demonstrations of the source in addition."""
    folder = tmp_path / "study"
    shutil.copytree(finished[1], folder)
    (folder / STUDY_FILE).unlink()
    study = run_study(_plan("rehearsal"), folder, executor=Serial())
    for tuned, rehearsed in zip(study.of("fine-tune"), study.of("rehearsal"), strict=True):
        assert [e.steps for e in rehearsed.curve] == [0, 30, 60, 120]
        assert rehearsed.curve[0] == tuned.curve[0]
    shown = folder / "demonstrations"
    source = LANE, 60, SharedFile(shown / "source-0.npz", 0)
    first = study.of("rehearsal")[0]

    def curve(rehearsed: tuple[EnvRef, int, SharedFile] | None) -> list[Evaluation]:
        found: list[Evaluation] = []
        _LEARNER.train(
            SLIPPERY,
            120,
            first.seed,
            demonstrations=SharedFile(shown / "scratch-0.npz", 0),
            start=load_policy(folder / "runs" / "source-0" / "policy.safetensors"),
            rehearsed=rehearsed,
            on_evaluation=found.append,
        )
        return found

    assert curve(source) == list(first.curve)
    assert curve(None) != list(first.curve)
    names = sorted(path.name for path in (folder / "demonstrations").iterdir())
    assert names == ["scratch-0.npz", "scratch-1.npz", "source-0.npz", "source-1.npz"]


def test_demonstrations_are_recorded_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file is reused, and recorded again if it has too few steps."""
    _cloned(tmp_path, 30)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["shown.npz"]
    _, found = _cloned(tmp_path, 120)
    asked: list[int] = []
    monkeypatch.setattr(cloning, "record_demonstrations", lambda *_: asked.append(1))
    assert _cloned(tmp_path, 120)[1] == found
    _cloned(tmp_path, 60)
    assert asked == []


def test_clones_are_evaluated_on_held_out_courses() -> None:
    envs = _LEARNER.evaluation_envs(LANE)
    try:
        assert len(envs) == 2
        for env in envs:
            assert env.reset(seed=1)[1]["course"] >= HELD_OUT
            steps, over = 0, False
            while not over:
                env.unwrapped.place = 0.0  # pyright: ignore[reportAttributeAccessIssue]
                _, _, terminated, truncated, _ = env.step(np.zeros(2, np.float32))
                over = terminated or truncated
                steps += 1
            assert steps == 25
    finally:
        for env in envs:
            env.close()


def test_a_study_of_clones(finished: tuple[Study, Path]) -> None:
    """Every arm, seed and budget is evaluated; zero-shot is where fine-tuning starts."""
    study, out = finished
    for kind in ("scratch", "fine-tune"):
        for result in study.of(kind):
            assert [e.steps for e in result.curve] == [0, 30, 60, 120]
    for unchanged, tuned in zip(study.of("zero-shot"), study.of("fine-tune"), strict=True):
        assert unchanged.curve[0].mean_return == tuned.curve[0].mean_return
    assert [e.steps for e in study.of("source")[0].curve] == [0, 60]
    assert set(study.summaries) == {"zero-shot", "fine-tune"}
    policy = load_policy(out / "runs" / "scratch-0" / "policy.safetensors")
    again = _LEARNER.evaluate(SLIPPERY, policy).mean_return
    assert again == study.of("scratch")[0].curve[-1].mean_return


def test_settings_that_contradict_themselves_are_refused() -> None:
    """Budgets must grow, and episodes have at least one step."""
    for budgets in ((), (0, 5), (5, 5), (10, 5)):
        with pytest.raises(StudyError, match="Budgets must be increasing"):
            msgspec.structs.replace(TINY_CLONING, budgets=budgets)
    for name in ("eval_episodes", "eval_steps", "episode_steps"):
        with pytest.raises(StudyError, match="must be at least 1"):
            msgspec.structs.replace(TINY_CLONING, **{name: 0})


def test_steps_are_rounded_up_to_a_budget() -> None:
    rounded = [TINY_CLONING.whole_updates(steps) for steps in (1, 30, 31, 120, 500)]
    assert rounded == [30, 30, 60, 120, 120]
    assert (TINY_CLONING.steps, TINY_CLONING.eval_every) == (120, 30)


def test_envs_without_a_demonstrator_are_refused() -> None:
    task = TransferTask(LANE, BIG)
    with pytest.raises(StudyError, match=r"InvertedPendulum-v1 has no camera, and cloning"):
        make_plan(task, "cloning", TINY_CLONING, seeds=2)


@pytest.mark.parametrize("vehicle", CLONES)
def test_the_clones_of_the_package_are_sources(vehicle: str) -> None:
    """The cards name the env and the 12,000 demonstrated steps."""
    settings = LEARNERS["cloning"]
    assert isinstance(settings, CloningSettings)
    env = EnvRef(f"shapechanger/{vehicle.capitalize()}-v1", {"put_back": True})
    origin = CloneLearner("cloning", settings).origin(CLONES[vehicle])
    assert (origin.env, origin.steps) == (env, 12_000)


@pytest.fixture(scope="module")
def clone_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of a clone of the demonstrator on the dry lane."""
    folder = tmp_path_factory.mktemp("clone")
    shown = SharedFile(folder / "shown.npz", 3)
    policy = CloneLearner("cloning", QUICK_CLONING).train(DRY, 40, 3, demonstrations=shown)
    policy.save(folder / "dry.safetensors")
    return folder / "dry.safetensors"


@pytest.fixture(scope="module")
def ppo_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("ppo") / "pole.safetensors"
    save_policy(Sb3Learner("tiny", TINY).train(SMALL, 32, 3), path)
    return path


def _given(source_policy: Path, source: EnvRef = DRY) -> Plan:
    task = TransferTask(source, ICY)
    return make_plan(task, "cloning", QUICK_CLONING, seeds=2, source_policy=source_policy)


def test_a_study_starts_from_a_given_clone(clone_file: Path, tmp_path: Path) -> None:
    """No source is trained; zero-shot is the clone, and every seed starts from it."""
    plan = _given(clone_file)
    assert plan.source_steps == 40
    study = run_study(plan, tmp_path / "study", source_policy=clone_file, executor=Serial())
    assert not study.of("source")
    assert study.source_return == ()
    (unchanged,) = study.of("zero-shot")
    learner = CloneLearner("cloning", QUICK_CLONING)
    worth = learner.evaluate(ICY, learner.load(clone_file)).mean_return
    assert unchanged.curve[0].mean_return == worth
    for tuned in study.of("fine-tune"):
        assert tuned.curve[0].mean_return == worth
        assert [evaluation.steps for evaluation in tuned.curve] == [0, 20, 40]


def test_a_study_resumes_with_its_planned_clone_only(clone_file: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.safetensors"
    load_policy(clone_file).carded(command="again").save(other)
    with pytest.raises(StudyError, match="not the policy that the plan names"):
        run_study(_given(clone_file), tmp_path / "study", source_policy=other, executor=Serial())


@pytest.mark.parametrize(
    ("source", "text"),
    [
        (WET, r"was trained in .*Dry-v1, and the source is .*Wet-v1"),
        (msgspec.structs.replace(DRY, kwargs={"grip": 0.1}), r"is .*Dry-v1 \(grip=0\.1\)"),
    ],
)
def test_a_clone_of_another_source_is_refused(clone_file: Path, source: EnvRef, text: str) -> None:
    with pytest.raises(SpaceMismatch, match=text):
        _given(clone_file, source)


def test_unsuitable_clones_are_refused(clone_file: Path, tmp_path: Path) -> None:
    """PPO cannot train a clone, and a clone of recordings has no source env."""
    with pytest.raises(PolicyError, match=r"dry\.safetensors is a clone .* tiny cannot train"):
        tiny_plan(source_policy=clone_file)
    path = tmp_path / "found.safetensors"
    CameraPolicy.fresh(QUICK_CLONING.clone, 0).save(path)
    with pytest.raises(PolicyError, match="learned from recordings without an env"):
        _given(path)


def test_source_steps_apply_to_arms_that_train_their_own_source(
    ppo_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The other arms start from the given source policy."""
    counted: list[int] = []

    def summarised(*arguments: Any, source_steps: int, **more: Any) -> Summary:
        counted.append(source_steps)
        return summarise(*arguments, source_steps=source_steps, **more)

    monkeypatch.setattr("shapechanger.transfer.study.summarise", summarised)
    arms = ("scratch", "zero-shot", "randomised")
    plan = tiny_plan(source_policy=ppo_file, source_steps=64, arms=arms)
    assert (plan.source_steps, plan.own_steps) == (32, 64)
    assert [plan.source_steps_of(arm) for arm in ("zero-shot", "randomised")] == [32, 64]
    assert [plan.steps_of(kind) for kind in ("zero-shot", "randomised")] == [0, 64]
    run_study(plan, tmp_path / "study", source_policy=ppo_file, executor=Serial())
    trained = load_policy(Run("randomised", 0).policy_file(tmp_path / "study"))
    assert trained.card.steps == 64
    assert counted == [32, 64]  # In total steps an arm is behind scratch by its source steps.
    with pytest.raises(StudyError, match="no arm trains its own policy"):
        tiny_plan(source_policy=ppo_file, source_steps=64)
