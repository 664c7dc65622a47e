"""Record, train, drive, correct and train again, with CLI commands."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from shapechanger.cli import main
from shapechanger.demos.dataset import load_dataset
from shapechanger.demos.episodes import episodes_of, read_episode
from shapechanger.policy import load_policy


@pytest.mark.gl
@pytest.mark.slow
def test_training_on_corrections_reduces_the_error(tmp_path: Path) -> None:
    shown, corrected, both = (str(tmp_path / name) for name in ("shown", "corrected", "both"))
    first, second = (str(tmp_path / name) for name in ("first.safetensors", "second.safetensors"))
    drive = ["demos", "record", "Car", "--minutes", "0.5", "--episode-s", "10", "--put-back"]
    main([*drive, "--out", shown])
    main(["demos", "train", shown, "--out", first, "--held-out", "0"])
    main([*drive, "--seed", "1000", "--out", corrected])  # On courses that are new to the policy.
    watched = ("--driver", first, "--corrected-by", "expert")
    main([*drive, "--seed", "2000", "--out", corrected, *watched])
    main(["demos", "merge", shown, corrected, "--out", both])
    main(["demos", "train", both, "--out", second, "--held-out", "0"])

    recorded = map(read_episode, episodes_of(Path(corrected)))
    drivers = {step.driver for episode in recorded for step in episode.steps}
    assert {"policy", "expert"} <= drivers
    data = load_dataset(Path(both))
    assert data.pictures is not None
    assert len(data) > len(load_dataset(Path(shown)))
    before, after = (load_policy(Path(p)).predict_many(data.pictures) for p in (first, second))
    errors = [float(np.abs(done - data.actions).mean()) for done in (before, after)]
    assert errors[1] < errors[0]
