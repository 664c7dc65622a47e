"""Films of a study's policies."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any, cast

import imageio.v3 as iio
import msgspec
import numpy as np
import pytest

from shapechanger.envs.catalogue import driven, env_ref
from shapechanger.transfer.executor import Serial
from shapechanger.transfer.learners.presets import learner_settings, resolve_learner
from shapechanger.transfer.plan import TransferTask
from shapechanger.transfer.references import reference_policy
from shapechanger.transfer.report.films import film_study
from shapechanger.transfer.study import make_plan, run_study
from tests.transfer.studies import tiny_plan

pytestmark = [pytest.mark.gl, pytest.mark.usefixtures("gl")]


@pytest.fixture(autouse=True)
def short_films(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shapechanger.transfer.report.films._FILM_S", 0.5)


def test_every_policy_is_filmed(tmp_path: Path) -> None:
    """The film shows the source in its body, each arm in the target, and scratch last."""
    plan = tiny_plan(steps=32, source_steps=32)
    study = run_study(plan, tmp_path / "study", executor=Serial())
    film = tmp_path / "film.mp4"
    strips = film_study(study, tmp_path / "study", film)
    assert [strip.caption.partition(":")[0] for strip in strips] == [
        *("source, in the source", "zero-shot", "fine-tune", "scratch")
    ]
    for strip in strips:
        picture = np.asarray(iio.imread(io.BytesIO(strip.jpeg)))
        assert picture.shape[0] == 180
        assert picture.std() > 1.0
        assert "return" in strip.caption
    assert film.stat().st_size > 1000
    frame = np.asarray(iio.imread(io.BytesIO(strips[0].jpeg)))[:90, :240, 0].astype(int)
    assert ((frame > 60) & (frame < 180)).sum() > 20


def test_a_given_source_policy_is_filmed(tmp_path: Path) -> None:
    """A study with a given source policy stores no copy of it, so the policy's file is passed."""
    policy = reference_policy("shapechanger/SmallInvertedPendulum-v1")
    short = {"n_envs": 2, "n_steps": 16, "batch_size": 16, "eval_every": 32, "eval_episodes": 1}
    _, settings = resolve_learner("ppo-balance", short)
    plan = tiny_plan(cast("Any", settings), steps=32, source_policy=policy)
    study = run_study(plan, tmp_path, source_policy=policy, executor=Serial())
    names = [one.caption.partition(":")[0] for one in film_study(study, tmp_path)]
    assert names == ["fine-tune", "scratch"]
    strips = film_study(study, tmp_path, source_policy=policy)
    names = [one.caption.partition(":")[0] for one in strips]
    assert names == ["source, in the source", "zero-shot", "fine-tune", "scratch"]


@pytest.mark.slow
def test_vehicles_are_filmed_from_outside(tmp_path: Path) -> None:
    """Envs of vehicles render the robot's camera image, so films use another camera."""
    source, target = driven(env_ref("CarWaypoint")), driven(env_ref("TankWaypoint"))
    whole = cast("Any", learner_settings("waypoint")).clone
    small = {"channels": (4, 8), "features": 8, "batch": 8}
    clone = msgspec.structs.replace(whole, fewest_steps=1, most_steps=1, **small)
    changes = {"budgets": [20], "episode_steps": 20, "eval_episodes": 1, "eval_steps": 20}
    _, settings = resolve_learner("waypoint", {**changes, "clone": msgspec.to_builtins(clone)})
    arms = ("scratch", "zero-shot")
    steps = {"seeds": 2, "steps": 20, "source_steps": 20}
    plan = make_plan(TransferTask(source, target), "waypoint", settings, arms=arms, **steps)
    study = run_study(plan, tmp_path / "study", executor=Serial())
    strips = film_study(study, tmp_path / "study")
    names = [strip.caption.partition(":")[0] for strip in strips]
    assert names == ["source, in the source", "zero-shot", "scratch"]
    pictures = [np.asarray(iio.imread(io.BytesIO(strip.jpeg)))[:, :240] for strip in strips]
    assert all(picture.std() > 1.0 for picture in pictures)
    # A car is red, and a tank is not.
    red = [float(each[..., 0].max()) - float(each[..., 1].max()) for each in pictures]
    assert red[0] > red[1]
