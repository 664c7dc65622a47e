"""Sampling of courses, starts and looks."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from shapechanger.envs.vehicle.base import CourseSampler
from shapechanger.errors import UnknownName, WorldError
from shapechanger.worlds.course import HELD_OUT, TRAINING


def _courses(draw: CourseSampler, n: int = 500) -> list[int]:
    rng = np.random.default_rng(1)
    return [draw.draw(rng, "corridor", {}).course for _ in range(n)]


@pytest.mark.parametrize(("name", "seeds"), [("training", TRAINING), ("held-out", HELD_OUT)])
def test_kinds_of_courses_keep_apart(name: Any, seeds: range) -> None:
    """Training and held-out courses are disjoint."""
    drawn = _courses(CourseSampler(name, randomise=False))
    assert all(course in seeds for course in drawn)
    assert max(drawn) - min(drawn) > 0.9 * len(seeds)


def test_holding_out_never_draws_what_vehicles_learn_on() -> None:
    """After `hold_out`, only held-out courses are drawn, also with given courses."""
    for courses in ("training", "held-out", (3, 4)):
        draw = CourseSampler(courses, randomise=False)
        draw.hold_out()
        assert not set(_courses(draw)) & set(TRAINING)
        assert all(course in HELD_OUT for course in _courses(draw))


def test_chosen_courses_are_all_drawn_and_no_others() -> None:
    """All given courses are drawn, and no others."""
    draw = CourseSampler((7, np.int64(9), 8), randomise=False)
    assert set(_courses(draw)) == {7, 8, 9}
    assert draw.first == 7


def test_options_replace_what_is_drawn_and_nothing_else() -> None:
    """Options do not change the other draws."""
    draw = CourseSampler("training", randomise=True)
    free = draw.draw(np.random.default_rng(5), "corridor", {})
    asked = draw.draw(np.random.default_rng(5), "corridor", {"course": 3})
    assert asked.course == 3
    assert (asked.start, asked.look, asked.camera) == (free.start, free.look, free.camera)
    assert draw.draw(np.random.default_rng(5), "corridor", {"start": 4}).course == free.course


def test_looks_are_drawn_only_where_they_are_to_be() -> None:
    """Looks are random only if requested."""
    plain = CourseSampler("training", randomise=False).draw(np.random.default_rng(5), "yard", {})
    assert (plain.look, plain.camera) == (None, None)
    draw, rng = CourseSampler("training", randomise=True), np.random.default_rng(5)
    one, two = (draw.draw(rng, "yard", {}) for _ in range(2))
    assert one.look != two.look
    assert one.camera != two.camera


def test_what_is_no_course_is_refused() -> None:
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
    ],
)
def test_options_that_are_none_are_refused(options: dict[str, Any], sentence: str) -> None:
    """Unknown or invalid options raise errors."""
    draw = CourseSampler("training", randomise=False)
    with pytest.raises((UnknownName, WorldError), match=sentence):
        draw.draw(np.random.default_rng(5), "corridor", options)
