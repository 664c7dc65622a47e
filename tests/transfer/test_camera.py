"""SAC from camera: it begins as a clone, remembers what it was shown, and is judged on the way."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import msgspec
import numpy as np
import pytest
import torch
from stable_baselines3.common.buffers import ReplayBuffer

from shapechanger.demos.cloning.policy import CameraPolicy
from shapechanger.errors import StudyError
from shapechanger.reports.study import write_report
from shapechanger.transfer.env_ref import EnvRef
from shapechanger.transfer.executor import Serial
from shapechanger.transfer.learners.camera import MixedReplay, train_camera_policy, train_camera_sac
from shapechanger.transfer.learners.cloning import DemonstrationFile, evaluate_clone
from shapechanger.transfer.learners.evaluation import Evaluation
from shapechanger.transfer.learners.settings import CameraSacSettings, learner_settings
from shapechanger.transfer.plan import TransferTask
from shapechanger.transfer.study import make_plan, run_study
from tests.transfer.lane import DRY, ICY, LANE, TINY_CLONING
from tests.transfer.studies import BIG

TINY_SAC = CameraSacSettings(
    demonstrated_steps=60,
    steps=120,
    episode_steps=20,
    eval_every=30,
    eval_episodes=2,
    eval_steps=25,
    learning_rate=3e-4,
    batch_size=16,
    gamma=0.9,
    ent_coef=0.01,
    critic_warm_up=20,
    anchor_rate=1e-3,
    clone=TINY_CLONING.clone,
)


@pytest.fixture(scope="module", autouse=True)
def one_thread() -> Iterator[None]:
    """Networks this small gain nothing from more."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


def _learned(
    folder: Path, steps: int = 120, seed: int = 5, *, only_last: bool = False
) -> tuple[CameraPolicy, list[Evaluation]]:
    found: list[Evaluation] = []
    policy = train_camera_sac(
        LANE,
        TINY_SAC,
        steps,
        seed,
        demonstrations=DemonstrationFile(folder / "shown.npz", 6),
        only_last=only_last,
        on_evaluation=found.append,
    )
    return policy, found


def test_it_is_judged_before_and_after_cloning_and_along_the_way(tmp_path: Path) -> None:
    """Steps count demonstrations and trying; the last evaluation is that of what is given back."""
    policy, found = _learned(tmp_path)
    assert [one.steps for one in found] == [0, 60, 90, 120]
    assert evaluate_clone(LANE, policy, TINY_SAC).mean_return == found[-1].mean_return
    assert policy.card.data["demonstrated_steps"] == 60
    assert policy.card.data["tried_steps"] == 60


def test_trying_changes_what_the_clone_does_and_not_what_it_sees(tmp_path: Path) -> None:
    """The eyes are the clone's, which was made of the same demonstrations."""
    shorter, longer = _learned(tmp_path, 90)[0].network, _learned(tmp_path, 120)[0].network
    for one, other in zip(shorter.eyes.parameters(), longer.eyes.parameters(), strict=True):
        assert torch.equal(one, other)
    assert not torch.equal(shorter.hands.weight, longer.hands.weight)


def test_the_same_seed_learns_the_same(tmp_path: Path) -> None:
    """With evaluations along the way or without; another seed learns something else."""
    _, found = _learned(tmp_path)
    _, last = _learned(tmp_path, only_last=True)
    assert [one.steps for one in last] == [0, 60, 120]
    assert last[-1] == found[-1]
    assert _learned(tmp_path, seed=6)[1][-1] != found[-1]


def test_half_of_a_batch_is_demonstrated() -> None:
    """As long as there are demonstrations."""
    model = torch.device("cpu")
    spaces = (LANE.make().action_space, LANE.make().action_space)
    replay, shown = (kind(8, *spaces, device=model) for kind in (MixedReplay, ReplayBuffer))
    for buffer, reward in ((replay, 1.0), (shown, 2.0)):
        for _ in range(8):
            nothing = np.zeros((1, 2), np.float32)
            buffer.add(nothing, nothing, nothing, np.array([reward]), np.zeros(1), [{}])
    assert (replay.sample(10).rewards == 1.0).all()
    replay.demonstrations = shown
    rewards = replay.sample(9).rewards.squeeze().tolist()
    assert rewards == [1.0] * 5 + [2.0] * 4


def test_a_study_of_it_is_a_study_as_any(tmp_path: Path) -> None:
    """Arms see the same demonstrations, fine-tuning begins with the source policy, and so on."""
    plan = make_plan(TransferTask(DRY, ICY), "sac-camera", TINY_SAC, seeds=2)
    assert (plan.steps, plan.source_steps) == (120, 90)
    study = run_study(plan, tmp_path / "study", executor=Serial())
    zero_shot, tuned = study.of("zero-shot"), study.of("fine-tune")
    for one, other in zip(zero_shot, tuned, strict=True):
        assert one.curve[0].mean_return == other.curve[0].mean_return
        assert [evaluation.steps for evaluation in other.curve] == [0, 60, 90, 120]
    shown = {path.name for path in (tmp_path / "study" / "demonstrations").iterdir()}
    assert shown == {f"{kind}-{i}.npz" for kind in ("source", "scratch") for i in range(2)}
    write_report(study, tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text()
    assert "30 steps of SAC, which starts after 60 demonstrated steps" in page


def test_a_budget_ends_with_an_evaluation() -> None:
    """And leaves at least one stretch of trying."""
    assert [TINY_SAC.whole_updates(steps) for steps in (1, 60, 90, 91, 120)] == [
        *(90, 90, 90, 120, 120)
    ]
    shipped = learner_settings("sac-camera")
    assert shipped.whole_updates(shipped.steps) == shipped.steps == 12_000


def test_settings_that_cannot_be_are_refused() -> None:
    """Nothing can be cloned from no step."""
    with pytest.raises(StudyError, match="at least one step of a demonstration"):
        msgspec.structs.replace(TINY_SAC, demonstrated_steps=0)


def test_the_anchor_keeps_it_near_to_what_was_shown(tmp_path: Path) -> None:
    """However wrong the critics are, what was demonstrated is not forgotten."""
    wild = msgspec.structs.replace(TINY_SAC, learning_rate=3e-2, critic_warm_up=0)
    errors: list[float] = []
    for rate in (0.0, 3e-2):
        policy = train_camera_sac(
            LANE,
            msgspec.structs.replace(wild, anchor_rate=rate),
            120,
            5,
            demonstrations=DemonstrationFile(tmp_path / "shown.npz", 6),
            on_evaluation=lambda evaluation: None,
        )
        with np.load(tmp_path / "shown.npz") as shown:
            apart = policy.predict_many(shown["pictures"]) - shown["actions"]
        errors.append(float(np.abs(apart).mean()))
    assert errors[1] < 0.7 * errors[0]


@pytest.mark.parametrize("order", [1, -1])
def test_envs_in_which_nobody_shows_how_are_refused(order: int) -> None:
    """Before anything is learned, with the name of the env."""
    task = TransferTask(*(LANE, BIG)[::order])
    with pytest.raises(
        StudyError, match=r"InvertedPendulum-v1 has no camera and no demonstrator, and sac-camera"
    ):
        make_plan(task, "sac-camera", TINY_SAC, seeds=2)


def test_training_without_a_camera_is_refused(tmp_path: Path) -> None:
    """As `train Ant --learner sac-camera` does: the sentence names what is missing."""
    ant = EnvRef("shapechanger/Ant-v1")
    with pytest.raises(
        StudyError, match="Ant-v1 has no camera and no demonstrator, and sac-camera learns"
    ):
        train_camera_policy(
            ant,
            TINY_SAC,
            90,
            0,
            demonstrations=DemonstrationFile(tmp_path / "shown.npz", 0),
            on_evaluation=lambda evaluation: None,
        )
