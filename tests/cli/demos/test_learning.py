"""`demos train` and `demos evaluate`."""

from __future__ import annotations

import html
import json
from pathlib import Path

import numpy as np
import pytest
import simplejpeg

from shapechanger.cli.demos.train import DemosEvaluate, DemosTrain
from shapechanger.demos.cloning.network import CameraPolicy
from shapechanger.demos.episodes import EpisodeHeader, EpisodeWriter, Step
from shapechanger.errors import DemosError, OutputError, PolicyError
from shapechanger.policy import load_policy
from tests.demos.cloning.data import KEYS, QUICK, STEERS, stripes


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Settings that train in seconds."""
    monkeypatch.setattr("shapechanger.demos.cloning.clone.DEMOS", QUICK)


def _record(folder: Path, n: int, seed: int, layout: object = KEYS) -> Path:
    """Record an episode as a person would drive it."""
    chosen = STEERS if layout is STEERS else KEYS
    data = stripes(n, seed, chosen)
    header = EpisodeHeader(action_layout=chosen.to_json(), image_size=(50, 33), clock="none")
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
    DemosEvaluate(
        out, _record(tmp_path / "other", 60, 1), report=tmp_path / "r" / "page.html"
    ).run()
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


def test_a_policy_for_another_layout_is_refused(tmp_path: Path) -> None:
    policy = CameraPolicy.fresh(QUICK, 0)
    policy.save(tmp_path / "p.safetensors")
    with pytest.raises(PolicyError, match=r"policy are steering, throttle, but .* forward"):
        DemosEvaluate(tmp_path / "p.safetensors", _record(tmp_path / "drive", 10, 0)).run()
