"""Films of a study's policies."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any, cast

import imageio.v3 as iio
import msgspec
import numpy as np
import pytest

from shapechanger.cli.env_arguments import driven, env_ref
from shapechanger.cli.films import film_study
from shapechanger.transfer.executor import Serial
from shapechanger.transfer.learners.presets import learner_settings, resolve_learner
from shapechanger.transfer.plan import TransferTask
from shapechanger.transfer.study import make_plan, run_study
from tests.transfer.studies import tiny_plan

pytestmark = [pytest.mark.gl, pytest.mark.usefixtures("gl")]


def test_every_policy_is_filmed(tmp_path: Path) -> None:
    """The source in its own body, each arm in the target, and scratch last."""
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


def test_vehicles_are_filmed_from_outside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Their envs render what the robot sees, not the robot."""
    source, target = driven(env_ref("CarWaypoint")), driven(env_ref("TankWaypoint"))
    whole = cast("Any", learner_settings("waypoint")).clone
    clone = msgspec.structs.replace(whole, fewest_steps=1, most_steps=1)
    changes = {"budgets": [20], "episode_steps": 20, "eval_episodes": 1, "eval_steps": 20}
    _, settings = resolve_learner("waypoint", {**changes, "clone": msgspec.to_builtins(clone)})
    plan = make_plan(
        TransferTask(source, target), "waypoint", settings, seeds=2, steps=20, source_steps=20
    )
    study = run_study(plan, tmp_path / "study", executor=Serial())
    monkeypatch.setattr("shapechanger.cli.films._FILM_S", 0.5)
    strips = film_study(study, tmp_path / "study")
    assert [strip.caption.partition(":")[0] for strip in strips] == [
        *("source, in the source", "zero-shot", "fine-tune", "scratch")
    ]
    pictures = [np.asarray(iio.imread(io.BytesIO(strip.jpeg)))[:, :240] for strip in strips]
    assert all(picture.std() > 1.0 for picture in pictures)
    # A car is red, and a tank is not.
    red = [float(each[..., 0].max()) - float(each[..., 1].max()) for each in pictures]
    assert red[0] > red[1]
