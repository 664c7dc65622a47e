"""Mistakes in a command line give one sentence, exit code 2 and no file."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest

from tests.cli.running import Cli


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("train Ant --learner ppo-rum", "Did you mean 'ppo-run'?"),
        ("train Ant --steps 10", "smaller than one evaluation"),
        ("transfer Ant ExtendedAnt --rule foot_1", "NAME=RULE"),
        ("transfer Ant ExtendedAnt --map none.toml", "cannot be read"),
        ("transfer Ant BigAnt --workers 0", "at least one worker"),
        ("transfer Ant BigAnt --arms scratch identified", "can adapt the source"),
        ("transfer Ant BigAnt --set learning_rat=1", "'learning_rate'"),
        ("train Ant --set learning_rate", "NAME=VALUE"),
        ("train Ant --set \"n_envs='a'\"", "n_envs"),
        ("train Ant --set gamma=0.9 gamma=0.8", "more than once"),
        ("train Ant --learner cloning", "Ant-v1 has no camera, and"),
        ("transfer Finger Finger --target-options '{'", "must be JSON"),
        ("play Ant --policy none.safetensors", "There is no policy file none.safetensors"),
        ("play Ant --policy referense", "did you mean reference?"),
        ("play Ant --episodes 0", "at least one episode"),
        ("train Ant --seed -1", "A seed is a whole number from 0"),
        ("transfer Ant BigAnt --map m --rule a=b", "leave out --rule"),
        (
            "transfer Ant BigAnt --arms scratch fine-tune fine-tune",
            "--arms names fine-tune more than once",
        ),
        ("train Car --tensorboard logs", "leave out --tensorboard"),
        ("train Ant --out .", "Cannot write .: it is a folder"),
        ("play Ant --out film.txt", "a film ends with one of .avi"),
        ("envs show BigAmt", "No environment matches 'BigAmt'. Did you mean 'BigAnt'?"),
        ("envs show Ant --body '[{'", "must be a JSON list of edits"),
        (
            'envs show Ant --body \'[{"edit":"stretch","body":"shank_9","factor":2}]\'',
            "No body matches 'shank_9'. Did you mean",
        ),
        ("envs compare CartPole-v1 Ant", "CartPole-v1 offers no certify_shift"),
        ("envs render CartPole-v1 --out x.png", "CartPole-v1 offers no picture"),
        ("envs show CartPole-v1", "publishes no observation_layout"),
        ("envs show CartPole-v1 --body Ant", "CartPole-v1 takes no body"),
        ("envs show a:b:c", "No environment matches 'a:b:c'"),
        ("envs show .a:b", "No environment matches '.a:b'"),
        ("envs render Ant --out x.png --width -5", "1 to 8192 pixels"),
        ("polices", "No command of `shapechanger` matches 'polices'. Did you mean 'policies'?"),
        ("policies shw", "`shapechanger policies` matches 'shw'. Did you mean 'show'?"),
        ("train Car --teacher", "--teacher needs a value after it"),
        ("transfer Car Tank --arms --seeds 1", "--arms needs a value"),
        ("train Car --teachr x", "matches '--teachr'. Did you mean '--teacher'?"),
        ("demos cut x --frm 4", "Did you mean '--from'?"),
        ("robot camera --profile x", "No option of `shapechanger robot camera` matches"),
        ("train Ant --bodies 3 --learner ppo-run", "ppo-run learns in one body: give --learner l"),
        ("train Ant --bodies 3 --body BigAnt", "--bodies takes a number above 0, and no --body"),
        ("train Car --bodies 3", "belongs to no family to draw from"),
        ("train HalfCheetah --bodies 70", "70 bodies need as many envs, and there are 64"),
        (
            "train Ant --bodies 3 --learner rsl-ppo --tensorboard logs",
            "rsl-limbs has no TensorBoard logs",
        ),
        (
            "transfer Ant BigAnt --arms scratch generalist",
            "generalist needs a policy that fits many bodies: give --learner limbs",
        ),
        ("train Ant --tensorboard file", "Cannot write file"),
        ("train Ant --out file/policy.safetensors", "Cannot write file"),
        (
            "train Ant --set gamma=0.9 --set n_epochs=5",
            "--set is given twice: give it once, with all its values after it.",
        ),
        ("robot serve car --policy a.onnx --policy=b.onnx", "one policy drives at a time"),
    ],
)
def test_mistakes_give_one_sentence(
    command: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cli: Cli
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").touch()
    assert words in " ".join(cli.refused(*shlex.split(command)).split())
    assert [path.name for path in tmp_path.rglob("*") if path.is_file()] == ["file"]
