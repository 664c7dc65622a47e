"""Camera policies, the students, that learn from a teacher that observes distances."""

import functools
from pathlib import Path

import msgspec
import numpy as np
import pytest

from shapechanger.cli.main import main
from shapechanger.contract.env_ref import EnvRef
from shapechanger.errors import StudyError
from shapechanger.policy import load_policy
from shapechanger.transfer.learners.policy_file import TrainedPolicy
from shapechanger.transfer.learners.sb3 import Sb3Learner
from shapechanger.transfer.learners.settings import PpoSettings
from shapechanger.vehicles.cloning import STUDENT_CLONING, train_student

_CAR = EnvRef("shapechanger/Car-v1", {"put_back": True})
_TINY = PpoSettings(
    n_envs=1, n_steps=8, batch_size=8, n_epochs=1, learning_rate=1e-3, steps=8, eval_every=8,
    eval_episodes=1, normalise=True,
)  # fmt: skip


@functools.cache
def _teacher(vehicle: str = "Car") -> TrainedPolicy:
    env = EnvRef(f"shapechanger/{vehicle}Ranges-v1", {"courses": [0, 1]})
    return Sb3Learner("tiny", _TINY).train(env, 8, 0, on_evaluation=lambda _: None)


@pytest.mark.gl
@pytest.mark.usefixtures("gl")
def test_a_student_learns_from_images(tmp_path: Path) -> None:
    """The saved policy acts on images, and its card names the teacher's env."""
    quick = msgspec.structs.replace(STUDENT_CLONING, fewest_steps=20, most_steps=20)
    done: list[int] = []
    policy = train_student(_CAR, _teacher(), 24, 3, settings=quick, on_steps=done.append)
    assert done == [8, 16, 24]
    assert policy.card.data["teacher"] == "shapechanger/CarRanges-v1"
    assert policy.card.steps == 24
    policy.save(tmp_path / "student.safetensors")
    again = load_policy(tmp_path / "student.safetensors")
    action = again.predict(np.zeros((120, 160, 3), np.uint8))
    assert action.shape == (2,)
    assert abs(action[0]) < 0.5
    assert 0.25 <= action[1] < 0.5


def test_unsuitable_teachers_are_refused() -> None:
    """Policies of other envs, envs without teachers and too few steps are refused."""
    for env, steps, given, text in (
        (_CAR, 10, _teacher("Tank"), "A teacher for shapechanger/Car-v1 is a policy of"),
        (EnvRef("shapechanger/CarRanges-v1"), 10, _teacher(), "CarRanges-v1 has no teachers"),
        (_CAR, 2, _teacher(), "at least 3 steps, got 2"),
    ):
        with pytest.raises(StudyError, match=text):
            train_student(env, given, steps, 0)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ("--teacher none.safetensors", "shapechanger train CarRanges"),
        (f"--teacher {__file__} --learner cloning", "--teacher excludes --learner"),
    ],
)
def test_unsuitable_arguments_of_train_are_refused(
    arguments: str, sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        main(["train", "Car", *arguments.split()])
    assert sentence in " ".join(capsys.readouterr().err.split())
