"""Which course, start and look the next episode has."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal, cast

import numpy as np

from shapechanger.envs.vehicle.asked import seed_as_asked
from shapechanger.errors import UnknownName, WorldError
from shapechanger.worlds.course import HELD_OUT, TRAINING
from shapechanger.worlds.look import Look
from shapechanger.worlds.mount import Jitter

__all__ = ["CourseDraw", "Courses", "Drawn"]

Courses = Literal["training", "held-out"] | Sequence[int]
"""Courses that vehicles learn on, those that they are judged on, or some by their seeds."""

_KINDS: Final = {"training": TRAINING, "held-out": HELD_OUT}
_OPTIONS: Final = ("course", "start")


@dataclass(frozen=True, slots=True)
class Drawn:
    """An episode's surroundings.

    Attributes:
        course: Seed of the course.
        start: Seed of the start.
        look: How it looks; None for as usual.
        camera: How far the camera is off its place; None for not at all.
    """

    course: int
    start: int
    look: Look | None
    camera: Jitter | None


class CourseDraw:
    """Draws the surroundings of episodes.

    Args:
        courses: Where courses come from.
        randomise: Whether looks and the camera's pose are drawn, too.

    Raises:
        UnknownName: If there are no courses of this name.
        WorldError: If there are none at all, or a seed is none.
    """

    def __init__(self, courses: Courses, randomise: bool) -> None:
        if isinstance(courses, str):
            if courses not in _KINDS:
                raise UnknownName("kind of courses", courses, _KINDS)
            self._seeds: Sequence[int] = _KINDS[courses]
        else:
            given: Any = courses  # Such as one seed alone, of somebody without a type checker.
            seeds = cast("Iterable[Any]", given if isinstance(given, Iterable) else (given,))
            self._seeds = tuple(seed_as_asked("course", seed) for seed in seeds)
        if not self._seeds:
            raise WorldError("There are no courses to draw from: give at least one seed.")
        self._randomise = randomise

    @property
    def first(self) -> int:
        """Seed of the first course."""
        return self._seeds[0]

    def hold_out(self) -> None:
        """Draw courses that no vehicle learns on from now on."""
        self._seeds = HELD_OUT

    def draw(self, rng: np.random.Generator, world: str, options: Mapping[str, Any]) -> Drawn:
        """The next episode's.

        Args:
            rng: What it is drawn with. What `options` give is drawn all the same, so that the rest
                does not depend on them.
            world: Kind of place.
            options: `course` and `start`, each a seed.

        Raises:
            UnknownName: If there is no such option.
            WorldError: If a seed is none.
        """
        for name in options:
            if name not in _OPTIONS:
                raise UnknownName("option of reset", name, _OPTIONS)
        course = self._seeds[int(rng.integers(len(self._seeds)))]
        start = int(rng.integers(2**31))
        look = Look.random(world, rng) if self._randomise else None
        camera = Jitter.random(rng) if self._randomise else None
        return Drawn(
            seed_as_asked("course", options.get("course", course)),
            seed_as_asked("start", options.get("start", start)),
            look,
            camera,
        )
