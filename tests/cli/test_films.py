"""Films of a study's policies."""

from __future__ import annotations

import io
from pathlib import Path

import imageio.v3 as iio
import msgspec
import numpy as np
import pytest

from shapechanger.cli.films import film_study
from shapechanger.transfer.executor import Serial
from shapechanger.transfer.learners.settings import learner_settings
from shapechanger.transfer.study import run_study
from tests.reports.studies import make_study
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


def test_camera_policies_are_not_filmed(tmp_path: Path) -> None:
    """Their envs render what the robot sees, not the robot."""
    study = make_study()
    plan = msgspec.structs.replace(study.plan, settings=learner_settings("cloning"))
    assert film_study(msgspec.structs.replace(study, plan=plan), tmp_path) == []
