"""Camera policies that learn from a teacher with distances."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest

from shapechanger.cli.main import main
from shapechanger.contract.env_ref import EnvRef
from shapechanger.errors import StudyError
from shapechanger.policy import load_policy, save_policy
from shapechanger.transfer.learners.policy_file import TrainedPolicy
from shapechanger.transfer.learners.sb3 import Sb3Learner
from shapechanger.transfer.learners.settings import PpoSettings
from shapechanger.vehicles.cloning import STUDENT_CLONING, train_student

_CAR = EnvRef("shapechanger/Car-v1", {"put_back": True})
_TINY = PpoSettings(
    n_envs=1,
    n_steps=8,
    batch_size=8,
    n_epochs=1,
    learning_rate=1e-3,
    steps=8,
    eval_every=8,
    eval_episodes=1,
    normalise=True,
)


def _teacher(vehicle: str = "Car") -> TrainedPolicy:
    env = EnvRef(f"shapechanger/{vehicle}Ranges-v1", {"courses": [0, 1]})
    return Sb3Learner("tiny", _TINY).train(env, 8, 0, on_evaluation=lambda _: None)


@pytest.fixture(scope="module")
def teacher() -> TrainedPolicy:
    """A barely trained teacher."""
    return _teacher()


@pytest.mark.gl
@pytest.mark.usefixtures("gl")
def test_a_student_sees_images_only(teacher: TrainedPolicy, tmp_path: Path) -> None:
    """The card names the teacher, and the student acts like it."""
    quick = msgspec.structs.replace(STUDENT_CLONING, fewest_steps=20, most_steps=20)
    done: list[int] = []
    policy = train_student(_CAR, teacher, 24, 3, settings=quick, on_steps=done.append)
    assert done == [8, 16, 24]
    assert policy.card.data["teacher"] == "shapechanger/CarRanges-v1"
    assert policy.card.steps == 24
    policy.save(tmp_path / "student.safetensors")
    again = load_policy(tmp_path / "student.safetensors")
    action = again.predict(np.zeros((120, 160, 3), np.uint8))
    assert action.shape == (2,)
    assert abs(action[0]) < 0.5
    assert 0.25 <= action[1] < 0.5


def test_unsuitable_teachers_are_refused(teacher: TrainedPolicy) -> None:
    """Policies of other envs, envs without teachers and too few steps are refused."""
    with pytest.raises(StudyError, match=r"A teacher for shapechanger/Car-v1 is a policy of"):
        train_student(_CAR, _teacher("Tank"), 10, 0)
    with pytest.raises(StudyError, match=r"CarRanges-v1 has no teachers"):
        train_student(EnvRef("shapechanger/CarRanges-v1"), teacher, 10, 0)
    with pytest.raises(StudyError, match="at least 3 steps, got 2"):
        train_student(_CAR, teacher, 2, 0)


def test_invalid_arguments_give_one_sentence(
    teacher: TrainedPolicy, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Wrong arguments are refused before the training."""
    path = tmp_path / "teacher.safetensors"
    save_policy(teacher, path)
    for arguments, sentence in (
        (
            ["Car", "--teacher", str(tmp_path / "none.safetensors")],
            "none.safetensors: `shapechanger train CarRanges`",
        ),
        (["Tank", "--teacher", str(path)], "train one by `shapechanger train TankRanges`"),
        (["Car", "--teacher", str(path), "--learner", "cloning"], "give --teacher without one"),
    ):
        with pytest.raises(SystemExit):
            main(["train", *arguments])
        assert sentence in " ".join(capsys.readouterr().err.split())
