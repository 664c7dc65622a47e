"""Recordings loaded as arrays."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import simplejpeg

from shapechanger.demos.dataset import load_dataset, merged
from shapechanger.demos.episodes import Drop, EpisodeWriter, edit
from shapechanger.errors import DemosError, UnknownName
from tests.demos.episodes.making import ACTIONS, STATES, header, step


def _jpeg(number: int, width: int = 32, height: int = 24) -> bytes:
    image = np.full((height, width, 3), 8 * number, np.uint8)
    return simplejpeg.encode_jpeg(image, quality=95)


def _recorded(recording: Path, steps: int = 6, **changes: Any) -> Path:
    """Record an episode with a new frame at every second step; a policy drives the last step."""
    about = header(**({"image_size": (32, 24)} | changes))
    with EpisodeWriter.create(recording, about, spare_bytes=0) as writer:
        for number in range(steps):
            driver = "policy" if number == steps - 1 else "person"
            one = step(number, action=(0.1 * number, 0.5), driver=driver)
            writer.add(one, _jpeg(number) if number % 2 == 0 else None)
    return writer.path


def test_kept_steps_of_persons_are_loaded_in_order(tmp_path: Path) -> None:
    first, _ = _recorded(tmp_path), _recorded(tmp_path)
    edit(first, Drop(1, 1, "bad"))
    data = load_dataset(tmp_path)
    assert data.episodes == (4, 5)
    np.testing.assert_allclose(data.actions[:, 0], [0, 0.2, 0.3, 0.4, 0, 0.1, 0.2, 0.3, 0.4])
    assert data.pictures is not None
    assert data.pictures.shape == (9, 24, 32, 3)
    brightness = data.pictures.mean(axis=(1, 2, 3)) / 8.0
    np.testing.assert_allclose(brightness, [0, 2, 2, 4, 0, 0, 2, 2, 4], atol=0.2)
    np.testing.assert_allclose(data.times_s[:4], [0.0, 0.1, 0.15, 0.2])
    assert data.states is not None
    assert data.states.shape == (9, 2)
    assert (data.action_layout, data.state_layout) == (ACTIONS, STATES)
    assert data.files[1].endswith("step 2")
    assert data.duration_s == pytest.approx(sum(data.times_s[[3, 8]]) + 2.0 / data.control_hz)


def test_parts_are_merged_to_the_whole(tmp_path: Path) -> None:
    for _ in range(2):
        _recorded(tmp_path)
    data = replace(load_dataset(tmp_path), states=None, state_layout=None)
    early = np.arange(len(data)) < 3
    parts = data.part(early), data.part(~early)
    assert [part.episodes for part in parts] == [(3,), (2, 5)]
    whole = merged(parts)
    assert whole.files == data.files
    for name in ("pictures", "actions", "times_s"):
        np.testing.assert_array_equal(getattr(whole, name), getattr(data, name))


def test_a_frame_shared_with_a_skipped_step_is_loaded_and_shrunk(tmp_path: Path) -> None:
    with EpisodeWriter.create(tmp_path, header(image_size=(32, 24)), spare_bytes=0) as writer:
        writer.add(step(0, driver="policy"), _jpeg(5))
        writer.add(step(1))
    data = load_dataset(tmp_path, shrink=lambda picture, _: picture[::2, ::2])
    assert data.pictures is not None
    assert data.pictures.shape == (1, 12, 16, 3)
    np.testing.assert_allclose(data.pictures.mean(), 40.0, atol=1.0)


def test_the_drivers_are_chosen_by_name(tmp_path: Path) -> None:
    path = _recorded(tmp_path)
    assert load_dataset(path, drivers=["policy"]).episodes == (1,)
    with pytest.raises(UnknownName, match="Did you mean 'policy'"):
        load_dataset(path, drivers=["polcy"])
    with pytest.raises(DemosError, match="no step of expert"):
        load_dataset(path, drivers=["expert"])


@pytest.mark.parametrize(
    ("changes", "what"),
    [
        ({"control_hz": 10.0}, "steps a second"),
        ({"action_layout": STATES}, "actions"),
        ({"state_layout": ACTIONS}, "states"),
        ({"image_size": None}, "pictures"),
    ],
)
def test_episodes_that_differ_are_not_mixed(
    tmp_path: Path, changes: dict[str, Any], what: str
) -> None:
    first, second = _recorded(tmp_path), _recorded(tmp_path, **changes)
    with pytest.raises(DemosError, match=f"{second} has other {what} than {first}: learn from"):
        load_dataset(tmp_path)


def test_a_frame_of_another_size_or_a_truncated_one_is_refused(tmp_path: Path) -> None:
    path = _recorded(tmp_path, image_size=(64, 24))
    with pytest.raises(DemosError, match=r"\(32, 24\) pixels, but the header \(64, 24\)"):
        load_dataset(path)
    with EpisodeWriter.create(tmp_path / "cut", header(), spare_bytes=0) as writer:
        writer.add(step(0), _jpeg(1)[:-40])
    with pytest.raises(DemosError, match=r"000000\.jpg is not a JPEG, or is damaged"):
        load_dataset(tmp_path / "cut")
