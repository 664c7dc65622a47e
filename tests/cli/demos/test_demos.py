"""`shapechanger demos`: record, show, edit, exchange and replay episodes, and learn from them."""

from __future__ import annotations

import html
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import simplejpeg

from shapechanger.cli import main
from shapechanger.cli.demos.recordings import DemosExport, DemosImport
from shapechanger.cli.demos.train import DemosEvaluate, DemosTrain
from shapechanger.demos.dataset import load_dataset
from shapechanger.demos.episodes import (
    Drop,
    EpisodeHeader,
    EpisodeWriter,
    Step,
    edit,
    episodes_of,
    read_episode,
)
from shapechanger.errors import DemosError, OutputError, PolicyError
from shapechanger.layout import Layout
from shapechanger.policy import load_policy
from shapechanger.vehicles.envs.demonstrators import CLONES
from tests.cli.running import Cli
from tests.demos.cloning.data import KEYS, QUICK, STEERS, stripes
from tests.demos.episodes.making import header, step
from tests.demos.exchange.small import drive, tub_folder


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """Two episodes with JPEG frames; in the first one, an expert corrects a policy."""
    for number, steps in enumerate((30, 10)):
        about = header(env="shapechanger/Car-v1", image_size=(40, 30), seed=number)
        with EpisodeWriter.create(tmp_path / "data", about, spare_bytes=0) as writer:
            for place in range(steps):
                driver = "policy" if number == 0 and place < 20 else "expert"
                writer.add(step(place, driver=driver, reward=0.5), grey(8 * place))
            writer.mark("a <b> bend")
            writer.close("time")
    return tmp_path / "data"


def grey(value: int) -> bytes:
    return simplejpeg.encode_jpeg(np.full((30, 40, 3), value, np.uint8))


def episodes(data: Path) -> list[Path]:
    return sorted(path for path in data.iterdir() if path.is_dir())


def test_show_prints_a_line_per_episode(data: Path, demos: Cli) -> None:
    first, second = episodes(data)
    with (second / "steps.jsonl").open("ab") as file:
        file.write(b"torn")
    printed = demos.output("show", data)
    line = next(line for line in printed.splitlines() if first.name in line)
    assert "Car-v1" in line
    assert "policy 67 %, expert 33 %" in line
    assert "1.5 s" in line
    assert line.rstrip().endswith("time")
    assert "cannot be read" in printed
    assert f"shapechanger demos repair {second}" in printed
    assert "2 episodes: 30 of 30 steps count" in printed


def test_show_prints_statistics(data: Path, demos: Cli) -> None:
    printed = demos.output("show", data)
    assert "driven by policy 50 %, expert 50 %" in printed
    assert "steering: 0.1 to 0.1, median 0.1" in printed
    assert "time between steps: 50 to 50 ms" in printed
    assert "ended by: time 2" in printed


def test_show_writes_a_self_contained_page(data: Path, tmp_path: Path, demos: Cli) -> None:
    first, second = episodes(data)
    demos.output("edit", "bad", first, "--from", 10, "--to", 19)
    damaged = second / "frames" / "000003.jpg"
    damaged.write_bytes(bytes(len(damaged.read_bytes())))
    page = tmp_path / "deep" / "page.html"
    assert f"wrote {page}" in demos.output("show", data, "--out", page)
    text = page.read_text()
    assert not re.search(r"<script|<link|@import|url\(|(src|href)=\"(?!data:|#)", text)
    assert "a &lt;b&gt; bend" in text
    assert "<b>" not in text
    assert text.count("data:image/jpeg;base64,") == 24 + 9
    assert text.count(">damaged<") == 1
    assert 'class="dropped"' in text
    assert "policy 33 % (10 steps)" in html.unescape(text)
    assert "20 of 30" in text


def test_edit_drops_restores_and_marks_steps(data: Path, demos: Cli) -> None:
    first, _ = episodes(data)
    assert "11 of 30 steps" in demos.output("edit", "cut", first, "--from", 5, "--to", 15)
    assert [s.index for s in read_episode(first).kept] == list(range(5, 16))
    assert "8 of 30 steps" in demos.output("edit", "bad", first, "--from", 7, "--to", 9)
    assert "10 of 30 steps" in demos.output("edit", "good", first, "--from", 8, "--to", 9)
    assert "0 of 30 steps" in demos.output("edit", "bad", first)
    assert "30 of 30 steps" in demos.output("edit", "good", first)
    demos.output("edit", "mark", first, "--from", 4, "--text", "a stone")
    assert [(mark.step, mark.text) for mark in read_episode(first).marks][1:] == [(4, "a stone")]


def test_merge_copies_each_episode_once(data: Path, tmp_path: Path, demos: Cli) -> None:
    """Different layouts are reported; duplicates are refused."""
    other = header(state_layout=Layout(()))
    with EpisodeWriter.create(tmp_path / "other", other, spare_bytes=0) as writer:
        writer.add(step(state=()))
    out = tmp_path / "all"
    printed = demos.output("merge", data, tmp_path / "other", "--out", out)
    assert "copied 3 episodes" in printed
    assert "2 different layouts" in printed
    assert "the same episode" in demos.refused("merge", data, "--out", out)


def test_repair_keeps_complete_steps(data: Path, demos: Cli) -> None:
    first, second = episodes(data)
    with (first / "steps.jsonl").open("ab") as file:
        file.write(b'{"kind":"step","st')
    (second / "frames" / "000009.jpg").unlink()
    printed = demos.output("repair", data)
    assert f"{first.name}: kept 30 steps, moved a line aside, because it is cut off" in printed
    assert f"{second.name}: kept 9 steps, moved a line aside" in printed
    assert demos.output("repair", data).count("found no damage") == 2


def test_one_episode_must_be_named(data: Path, demos: Cli) -> None:
    first, second = episodes(data)
    assert f"has 2 episodes: name one of them, such as {first}" in demos.refused(
        "edit", "bad", data
    )
    near = data / f"{second.name[:-1]}9"
    assert f"Did you mean {second.name!r}" in demos.refused("edit", "cut", near)
    sentence = demos.refused("edit", "cut", first, "--from", 20, "--to", 40)
    assert "has the steps 0 to 29, and not 20 to 40" in sentence
    assert "and not 50 to 50" in demos.refused("edit", "mark", first, "--from", 50)
    assert "without --to" in demos.refused("edit", "mark", first)
    assert "--text is for mark" in demos.refused("edit", "bad", first, "--text", "x")
    assert "There is no recording" in demos.refused("show", data / "no" / "such")
    shutil.rmtree(second)
    assert "0 of 30 steps" in demos.output("edit", "bad", data)


def test_replay_needs_one_target(data: Path, demos: Cli) -> None:
    first, _ = episodes(data)
    assert "one of --film, --env and --robot" in demos.refused("replay", first)
    demos.output("edit", "bad", first)
    assert "demos edit good" in demos.refused("replay", first, "--film", "a.mp4")


def test_a_film(data: Path, tmp_path: Path, demos: Cli) -> None:
    import imageio_ffmpeg

    first, _ = episodes(data)
    demos.output("edit", "cut", first, "--to", 19)
    assert "20 steps, 1.0 s" in demos.output("replay", first, "--film", tmp_path / "a.mp4")
    assert imageio_ffmpeg.count_frames_and_secs(str(tmp_path / "a.mp4")) == (20, 1.0)
    assert "a film ends with one of" in demos.refused("replay", first, "--film", tmp_path / "a.txt")


def test_an_env_with_other_actions_is_refused(data: Path, demos: Cli) -> None:
    first, _ = episodes(data)
    sentence = demos.refused("replay", first, "--env", "Ant")
    assert "hip_1/motor" in sentence
    assert "has steering, throttle" in sentence


SHORT = ("--minutes", "0.05", "--episode-s", "2", "--options", '{"size": [64, 48]}')


@pytest.mark.usefixtures("gl")
@pytest.mark.gl
def test_an_experts_recording_replays_identically(tmp_path: Path, demos: Cli) -> None:
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
def test_an_expert_corrects_a_policy(tmp_path: Path, demos: Cli) -> None:
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
    ("arguments", "message"),
    [
        (["Ant"], "has no expert"),
        (["Car", "--minutes", "0"], "--minutes must be above 0"),
        (["Car", "--driver", "expret"], "no driver 'expret'"),
        (["Car", "--corrected-by", "expert"], "Only a policy can be corrected"),
        (["Car", "--corrected-by", "me"], "corrected by expert"),
        (["Car", "--options", '{"colour": 3}'], "colour"),
        (["Car", "--seed", "-1"], "A seed must be"),
        (["Ant", "--put-back"], "need a vehicle's env"),
    ],
)
def test_invalid_arguments_give_one_sentence(
    arguments: list[str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    demos: Cli,
    gl: None,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert message in demos.refused("record", *arguments, "--out", "data")
    assert not Path("data").exists()


@pytest.mark.usefixtures("gl")
@pytest.mark.gl
def test_ctrl_c_leaves_complete_episodes(
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


def test_a_partial_import_has_a_separate_exit_code(
    tmp_path: Path, demos: Cli, capsys: pytest.CaptureFixture[str]
) -> None:
    """The exit code is 0 if all is imported, 3 for a part and 2 if all failed."""
    fields = {"user/angle": 0.0, "user/throttle": 0.0, "lap": 1}
    records = [fields | {"_timestamp_ms": 51 * n} for n in range(30)]
    tub = tub_folder(tmp_path / "tub", records)
    for n in (3, 5, 8, 9):
        (tub / f"images/{n}_cam_image_array_.jpg").write_bytes(b"")
    command = ["demos", "import", str(tub), "--out", str(tmp_path / "data")]
    sentence = demos.refused(*command[1:], "--strict")
    assert "is incomplete (record 3: an empty image)" in sentence
    assert not (tmp_path / "data").exists()
    with pytest.raises(SystemExit) as ended:
        main(command)
    assert ended.value.code == 3
    output = capsys.readouterr()
    assert "1 episode, 26 steps, 26 images" in output.out
    assert "note: Columns that are not imported: lap.\n" in output.out
    assert "so 20 Hz are assumed; --hz sets the rate.\n" in output.out
    assert output.err == "left out: record 3, record 5, record 8, ... (4 in all): an empty image\n"
    with pytest.raises(SystemExit) as ended:
        main(["demos", "import", str(tub), "--out", str(tmp_path / "b"), "--hz", "10"])
    assert ended.value.code == 3
    assert "their times are left out" in capsys.readouterr().out


def test_export_prints_a_summary_and_how_to_load(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = drive(tmp_path / "data")
    edit(path, Drop(1, 2, "bad"))
    DemosExport(tmp_path / "data", tmp_path / "sets/drive-v0", "minari").run()
    output = capsys.readouterr().out
    assert "3 steps of 2 episodes\n" in output
    assert "so episodes are split at pauses and where steps are excluded" in output
    assert "note: Dropped steps are left out (2); --dropped includes them." in output
    assert f"MINARI_DATASETS_PATH={tmp_path / 'sets'}" in output
    assert "minari.load_dataset('drive-v0')" in output
    DemosExport(tmp_path / "data", tmp_path / "csv", "csv", dropped=True).run()
    assert "5 steps of 1 episode\n" in capsys.readouterr().out


def test_export_to_lerobot_and_mcap(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    edit(drive(tmp_path / "data"), Drop(0, 0, "bad"))
    DemosExport(tmp_path / "data", tmp_path / "set", "lerobot", task="Drive.", images=True).run()
    output = capsys.readouterr().out
    assert "4 steps of 1 episode\nnote: Dropped steps are left out (1).\n" in output
    assert f"LeRobotDataset('set', root='{tmp_path / 'set'}')" in output
    DemosImport(tmp_path / "set", tmp_path / "back", camera="camera").run()
    assert "(lerobot): 1 episode, 4 steps, 4 images" in capsys.readouterr().out
    DemosExport(tmp_path / "data", tmp_path / "logs", "mcap").run()
    assert "left out (1); --dropped includes them" in capsys.readouterr().out


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shapechanger.demos.cloning.clone.DEMOS", QUICK)


def _record(folder: Path, n: int, seed: int, layout: object = KEYS) -> Path:
    chosen = STEERS if layout is STEERS else KEYS
    data = stripes(n, seed, chosen)
    header = EpisodeHeader(action_layout=chosen, image_size=(50, 33), clock="none")
    assert data.pictures is not None
    with EpisodeWriter.create(folder, header) as writer:
        for picture, action in zip(data.pictures, data.actions, strict=True):
            jpeg = simplejpeg.encode_jpeg(np.ascontiguousarray(picture), quality=95)
            writer.add(Step(action=tuple(map(float, action)), driver="person"), jpeg)
        writer.close()
    return folder


def test_a_recording_becomes_a_policy_with_a_report(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`train` writes policy, report and exports; `evaluate` prints the accuracy last."""
    data = _record(tmp_path / "drive", 150, 0)
    out = tmp_path / "made" / "policy.safetensors"
    DemosTrain(data, out, ppo=tmp_path / "made" / "ppo.zip").run()
    made = sorted(path.name for path in out.parent.iterdir())
    assert made == ["policy.html", "policy.json", "policy.safetensors", "ppo.zip"]
    page = out.with_suffix(".html").read_text()
    assert page.count("data:image/png;base64,") == 12
    assert "http" not in page.replace("http://www.w3.org", "")
    report = json.loads(out.with_suffix(".json").read_text())
    assert report["evaluation"]["steps"] == 30
    assert "from 0.1 minutes" in report["outlook"]  # 120 of 150 steps at 20 Hz.
    printed = " ".join(capsys.readouterr().out.split())
    assert report["outlook"] in printed
    assert report["outlook"] in " ".join(html.unescape(page).split())
    assert load_policy(out).card.steps == 120
    capsys.readouterr()
    DemosEvaluate(out, data).run()
    lines = capsys.readouterr().out.splitlines()
    assert "learned from the first 120 of these 150 steps" in " ".join(lines)
    capsys.readouterr()
    other = _record(tmp_path / "other", 60, 1)
    DemosEvaluate(out, other, report=tmp_path / "r" / "page.html").run()
    lines = capsys.readouterr().out.splitlines()
    report = json.loads((tmp_path / "r" / "page.json").read_text())
    assert lines[-1] == f"accuracy {report['evaluation']['accuracy']:.3f}"
    assert report["evaluation"]["accuracy"] > 0.8


def test_regression_prints_errors_and_accuracy(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = _record(tmp_path / "drive", 90, 0, STEERS)
    _record(data, 30, 1, STEERS)
    out = tmp_path / "policy.safetensors"
    DemosTrain(data, out, split="episode", sac=tmp_path / "sac.zip").run()
    assert load_policy(out).card.steps == 90
    text = capsys.readouterr().out
    assert "steering: mean absolute error" in text
    assert text.splitlines()[-1].startswith("accuracy ")
    assert out.with_suffix(".html").exists()


def test_invalid_arguments_are_refused_before_training(tmp_path: Path) -> None:
    data = _record(tmp_path / "drive", 20, 0)
    (tmp_path / "taken").mkdir()
    with pytest.raises(OutputError, match="it is a folder"):
        DemosTrain(data, tmp_path / "taken").run()
    with pytest.raises(OutputError, match="two files"):
        DemosTrain(data, tmp_path / "p.safetensors", sac=tmp_path / "p.safetensors").run()
    with pytest.raises(DemosError, match="one episode only"):
        DemosTrain(data, tmp_path / "p.safetensors", split="episode").run()
    with pytest.raises(DemosError):
        DemosTrain(tmp_path / "nowhere", tmp_path / "p.safetensors").run()
    with pytest.raises(PolicyError, match="no policy file"):
        DemosEvaluate(tmp_path / "p.safetensors", data).run()
    assert not (tmp_path / "p.safetensors").exists()
