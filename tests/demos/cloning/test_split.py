"""Which steps judge, and which choose when to stop."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.demos.cloning.demonstrations import judged_steps, stretch
from shapechanger.demos.cloning.pictures import CloningError


def test_by_time_the_last_steps_judge() -> None:
    """Over all episodes."""
    assert np.flatnonzero(judged_steps([6, 4], "time", 0.3)).tolist() == [7, 8, 9]
    assert not judged_steps([6, 4], "time", 0.0).any()


def test_by_episode_whole_ones_judge() -> None:
    """At least the share, at least one, and never all."""
    assert np.flatnonzero(judged_steps([6, 3, 1], "episode", 0.2)).tolist() == [6, 7, 8, 9]
    assert np.flatnonzero(judged_steps([6, 4], "episode", 0.01)).tolist() == [6, 7, 8, 9]
    assert judged_steps([6, 4], "episode", 0.99).sum() == 4


def test_what_cannot_be_split_is_refused() -> None:
    """With the way out."""
    with pytest.raises(CloningError, match=r"one episode only.*split by time"):
        judged_steps([10, 0], "episode", 0.2)
    with pytest.raises(CloningError, match=r"share must be in \[0, 1\)"):
        judged_steps([10], "time", 1.0)


def test_each_member_leaves_out_a_stretch_of_its_own() -> None:
    """Together they learn from all, and the last leaves out the end."""
    masks = [stretch(100, member, 4, 0.15) for member in range(4)]
    assert [int(mask.sum()) for mask in masks] == [15] * 4
    assert sum(masks).max() == 1  # pyright: ignore[reportAttributeAccessIssue]
    assert masks[3][85:].all()
    assert all(np.ptp(np.flatnonzero(mask)) == 14 for mask in masks)


def test_a_stretch_never_takes_nearly_all() -> None:
    """However few steps and however large the share."""
    assert stretch(3, 0, 1, 0.9).sum() == 1
    assert stretch(1, 0, 4, 0.5).sum() == 0
