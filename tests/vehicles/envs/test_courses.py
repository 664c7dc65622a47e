"""Sampling of courses, starts and looks."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from shapechanger.errors import UnknownName, WorldError
from shapechanger.vehicles.courses.course import HELD_OUT, TRAINING
from shapechanger.vehicles.envs.drive import CourseSampler


def _courses(draw: CourseSampler, n: int = 500) -> list[int]:
    rng = np.random.default_rng(1)
    return [draw.draw(rng, "corridor", {}).course for _ in range(n)]


@pytest.mark.parametrize(("name", "seeds"), [("training", TRAINING), ("held-out", HELD_OUT)])
def test_training_and_held_out_courses_are_disjoint(name: Any, seeds: range) -> None:
    """Each kind draws from its own range of seeds, and covers it."""
    drawn = _courses(CourseSampler(name, randomise=False))
    assert all(course in seeds for course in drawn)
    assert max(drawn) - min(drawn) > 0.9 * len(seeds)


def test_hold_out_draws_held_out_courses_only() -> None:
    for courses in ("training", "held-out", (3, 4)):
        draw = CourseSampler(courses, randomise=False)
        draw.hold_out()
        assert not set(_courses(draw)) & set(TRAINING)
        assert all(course in HELD_OUT for course in _courses(draw))


def test_given_courses_are_drawn() -> None:
    draw = CourseSampler((7, np.int64(9), 8), randomise=False)
    assert set(_courses(draw)) == {7, 8, 9}
    assert draw.first == 7


def test_options_do_not_change_other_draws() -> None:
    """A given course or start leaves the other random choices unchanged."""
    draw = CourseSampler("training", randomise=True)
    free = draw.draw(np.random.default_rng(5), "corridor", {})
    asked = draw.draw(np.random.default_rng(5), "corridor", {"course": 3})
    assert asked.course == 3
    assert (asked.start, asked.look, asked.camera) == (free.start, free.look, free.camera)
    assert draw.draw(np.random.default_rng(5), "corridor", {"start": 4}).course == free.course


def test_looks_are_random_only_if_requested() -> None:
    """Without `randomise`, look and camera are None."""
    plain = CourseSampler("training", randomise=False).draw(np.random.default_rng(5), "yard", {})
    assert (plain.look, plain.camera) == (None, None)
    draw, rng = CourseSampler("training", randomise=True), np.random.default_rng(5)
    one, two = (draw.draw(rng, "yard", {}) for _ in range(2))
    assert one.look != two.look
    assert one.camera != two.camera


def test_invalid_courses_are_refused() -> None:
    """Invalid courses raise errors that state what is valid."""
    with pytest.raises(UnknownName, match=r"No kind of courses matches 'hold-out'. Did you mean"):
        CourseSampler("hold-out", randomise=False)  # pyright: ignore[reportArgumentType]
    with pytest.raises(WorldError, match="no courses to draw from: give at least one seed"):
        CourseSampler((), randomise=False)
    for seed in (-1, 1.5, "a", None):
        with pytest.raises(WorldError, match="The seed of a course must be a whole number from 0"):
            CourseSampler((seed,), randomise=False)  # pyright: ignore[reportArgumentType]


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
    draw = CourseSampler("training", randomise=False)
    with pytest.raises((UnknownName, WorldError), match=sentence):
        draw.draw(np.random.default_rng(5), "corridor", options)
