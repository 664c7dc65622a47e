"""`shapechanger demos record` in a real env, and its replay."""

from __future__ import annotations

from pathlib import Path

import pytest

from shapechanger.cli import main
from shapechanger.demos.dataset import load_dataset
from shapechanger.demos.episodes import episodes_of, read_episode
from shapechanger.vehicles.envs.demonstrators import CLONES
from tests.cli.running import Cli

SHORT = ("--minutes", "0.05", "--episode-s", "2", "--options", '{"size": [64, 48]}')


@pytest.mark.usefixtures("gl")
@pytest.mark.gl
def test_an_experts_recording_replays_identically(tmp_path: Path, demos: Cli) -> None:
    """State and images are equal in every step; each episode has its seed."""
    data = tmp_path / "data"
    printed = demos.output("record", "Car", "--out", data, "--seed", 7, *SHORT)
    assert "wrote 60 steps" in printed
    first, second = (read_episode(path) for path in episodes_of(data))
    assert (len(first.steps), len(second.steps)) == (40, 20)
    assert (first.outcome, second.outcome) == ("time", "")
    assert (first.header.seed, second.header.seed) == (7, 8)
    assert first.header.env == "shapechanger/Car-v1"
    assert first.header.body == "car"
    assert (first.header.camera_pitch_deg, first.header.camera_fovy_deg) == (0.0, 48.8)
    assert first.header.image_size == (64, 48)
    assert {step.driver for step in first.steps} == {"expert"}
    assert any(step.action != step.applied for step in first.steps)
    assert load_dataset(data).pictures is not None
    printed = demos.output("replay", first.path, "--env", "Car")
    assert "played 40 of 40 steps" in printed
    assert "the state is the same in every step" in printed
    assert "the images are the same in every step" in printed
    printed = demos.output("replay", first.path, "--env", "Tank")
    assert "when recorded" in printed


@pytest.mark.usefixtures("gl")
@pytest.mark.gl
def test_a_policy_is_corrected(tmp_path: Path, demos: Cli) -> None:
    """Only the expert's steps are loaded for learning."""
    data = tmp_path / "data"
    policy = ("--driver", str(CLONES["boat"]), "--corrected-by", "expert")
    printed = demos.output("record", "Car", "--out", data, "--minutes", "0.1", *policy)
    (path,) = episodes_of(data)
    episode = read_episode(path)
    drivers = [step.driver for step in episode.steps]
    assert set(drivers) == {"policy", "expert"}
    corrected = [step for step in episode.steps if step.driver == "expert"]
    assert all(step.wanted is not None for step in corrected)
    assert all(step.wanted is None for step in episode.steps if step.driver == "policy")
    assert "the expert takes over" in episode.marks[0].text
    assert len(load_dataset(data)) == len(corrected)
    assert f" of the steps, {len(corrected)} of 120, and took over " in printed
    assert episode.header.notes["corrected_by"] == "expert"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["Ant"], "has no expert"),
        (["Car", "--minutes", "0"], "--minutes is more than 0"),
        (["Car", "--driver", "expret"], "no driver 'expret'"),
        (["Car", "--corrected-by", "expert"], "needs no correction"),
        (["Car", "--corrected-by", "me"], "corrected by expert"),
        (["Car", "--options", '{"colour": 3}'], "colour"),
        (["Car", "--seed", "-1"], "A seed is"),
        (["Ant", "--put-back"], "are for vehicles"),
    ],
)
def test_invalid_arguments_give_one_sentence(
    arguments: list[str],
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    demos: Cli,
    gl: None,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert words in demos.refused("record", *arguments, "--out", "data")
    assert not Path("data").exists()


@pytest.mark.usefixtures("gl")
@pytest.mark.gl
def test_ctrl_c_leaves_whole_episodes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, demos: Cli, capsys: pytest.CaptureFixture[str]
) -> None:
    from shapechanger.vehicles.envs.demonstrators import Demonstrator

    acts = Demonstrator.act
    calls = iter(range(100))

    def interrupted(self: Demonstrator) -> object:
        if next(calls) == 10:
            raise KeyboardInterrupt
        return acts(self)

    monkeypatch.setattr(Demonstrator, "act", interrupted)
    with pytest.raises(SystemExit) as stop:
        main(["demos", "record", "Car", "--out", str(tmp_path / "data"), *SHORT])
    assert stop.value.code == 130
    assert "is in" in capsys.readouterr().err
    (path,) = episodes_of(tmp_path / "data")
    episode = read_episode(path)
    assert (len(episode.steps), episode.closed, episode.outcome) == (10, True, "stopped")
