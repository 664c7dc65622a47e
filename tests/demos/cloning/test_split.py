"""Splits into training and test steps, and held-out stretches of members."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.demos.cloning.examples import evaluated_steps, stretch
from shapechanger.demos.cloning.pictures import CloningError


def test_split_by_time() -> None:
    """The last steps over all episodes are the test set."""
    assert np.flatnonzero(evaluated_steps([6, 4], "time", 0.3)).tolist() == [7, 8, 9]
    assert not evaluated_steps([6, 4], "time", 0.0).any()


def test_split_by_episode() -> None:
    """Whole episodes: at least the share, at least one, never all."""
    assert np.flatnonzero(evaluated_steps([6, 3, 1], "episode", 0.2)).tolist() == [6, 7, 8, 9]
    assert np.flatnonzero(evaluated_steps([6, 4], "episode", 0.01)).tolist() == [6, 7, 8, 9]
    assert evaluated_steps([6, 4], "episode", 0.99).sum() == 4


def test_invalid_splits_are_refused() -> None:
    with pytest.raises(CloningError, match=r"one episode only.*split by time"):
        evaluated_steps([10, 0], "episode", 0.2)
    with pytest.raises(CloningError, match=r"share must be in \[0, 1\)"):
        evaluated_steps([10], "time", 1.0)


def test_each_member_holds_out_its_own_stretch() -> None:
    masks = [stretch(100, member, 4, 0.15) for member in range(4)]
    assert [int(mask.sum()) for mask in masks] == [15] * 4
    assert sum(masks).max() == 1  # pyright: ignore[reportAttributeAccessIssue]
    assert masks[3][85:].all()
    assert all(np.ptp(np.flatnonzero(mask)) == 14 for mask in masks)


def test_a_stretch_is_limited() -> None:
    assert stretch(3, 0, 1, 0.9).sum() == 1
    assert stretch(1, 0, 4, 0.5).sum() == 0
