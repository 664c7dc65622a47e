"""Sampling of courses, starts and looks."""

from __future__ import annotations

from contextlib import closing
from typing import Any

import numpy as np
import pytest

from shapechanger.errors import UnknownName, WorldError
from shapechanger.vehicles.courses.course import HELD_OUT, TRAINING
from shapechanger.vehicles.envs import RangesEnv


def _courses(courses: Any, n: int = 6, *, held_out: bool = False) -> list[int]:
    with closing(RangesEnv("car", courses=courses)) as env:
        if held_out:
            env.hold_out()
        return [env.reset(seed=1 if i == 0 else None)[1]["course"] for i in range(n)]


@pytest.mark.parametrize(
    ("courses", "held_out", "seeds"),
    [
        ("training", False, TRAINING),
        ("held-out", False, HELD_OUT),
        ("training", True, HELD_OUT),
        ((3, 4), True, HELD_OUT),
        ((7, np.int64(9)), False, {7, 9}),
    ],
)
def test_courses_are_drawn_from_their_seeds(courses: Any, held_out: bool, seeds: Any) -> None:
    drawn = _courses(courses, held_out=held_out)
    assert all(course in seeds for course in drawn)
    assert len(set(drawn)) > 1
    assert not set(TRAINING) & set(HELD_OUT)


def test_options_do_not_change_other_draws() -> None:
    """A given course or start leaves the other random choices unchanged."""
    with closing(RangesEnv("car", randomise=True)) as env:

        def drawn(**options: int) -> tuple[int, Any, Any]:
            info = env.reset(seed=5, options=options)[1]
            return info["course"], env.world.look, info["pose"]

        course, look, pose = drawn()
        assert drawn(course=course) == (course, look, pose)
        assert drawn(start=4)[:2] == (course, look)
        assert drawn(start=4)[2] == drawn(start=4)[2] != pose
        other = drawn(course=course + 1)
        assert other[:2] == (course + 1, look)
        env.reset()
        assert env.world.look != look


@pytest.mark.parametrize("courses", [(-1,), (1.5,), ("a",), (None,)])
def test_invalid_seeds_of_courses_are_refused(courses: Any) -> None:
    with pytest.raises(WorldError, match="The seed of a course must be a whole number from 0"):
        RangesEnv("car", courses=courses)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"curse": 1}, "No option of reset matches 'curse'. Did you mean 'course'"),
        ({"course": "a"}, "The seed of a course must be a whole number from 0, got 'a'"),
        ({"course": -1}, "The seed of a course must be a whole number from 0, got -1"),
        ({"start": -1}, "The seed of a start must be a whole number from 0, got -1"),
        ({"start": 0.5}, "The seed of a start must be a whole number from 0, got 0.5"),
        ({"start": True}, "The seed of a start must be a whole number from 0, got True"),
    ],
)
def test_invalid_options_are_refused(options: dict[str, Any], sentence: str) -> None:
    """Unknown or invalid options raise errors."""
    with (
        closing(RangesEnv("car", courses=(0,))) as env,
        pytest.raises((UnknownName, WorldError), match=sentence),
    ):
        env.reset(options=options)
