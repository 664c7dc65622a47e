"""What somebody asks a vehicle's env for: refused in words, or brought into form."""

from __future__ import annotations

import dataclasses
import operator
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal, cast

import numpy as np

from shapechanger.errors import ProfileError, SpaceMismatch, UnknownName, WorldError
from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.robot.profile.profile import Profile
from shapechanger.worlds.camera import CameraJitter
from shapechanger.worlds.course import HELD_OUT, TRAINING
from shapechanger.worlds.look import Look

__all__ = [
    "CourseSampler",
    "Courses",
    "EpisodeSetup",
    "Steering",
    "check_frame_size",
    "check_seed",
    "resolve_profile",
]

Steering = Literal["proportional", "bang"]
"""How the wheels turn: anywhere, or full left, straight and full right only, as in 2017."""

_LEVELS: Final[dict[str, Literal["any", "three"]]] = {"proportional": "any", "bang": "three"}
_LARGEST: Final = 1920  # Pixels, as in a profile.


def check_frame_size(size: Sequence[int]) -> tuple[int, int]:
    """Width and height of pictures in pixels.

    Raises:
        SpaceMismatch: If no picture has this size.
    """
    try:
        wide, high = (operator.index(pixels) for pixels in size)
    except (TypeError, ValueError):
        wide = high = 0
    if not (1 <= wide <= _LARGEST and 1 <= high <= _LARGEST):
        raise SpaceMismatch(
            f"The size of a picture is its width and its height, each 1 to {_LARGEST} pixels, got "
            f"{size}."
        )
    return wide, high


def check_seed(what: str, seed: Any) -> int:
    """The seed of a course or a start.

    Raises:
        WorldError: If it is none.
    """
    try:
        number = operator.index(seed)
    except TypeError:
        number = -1
    if number < 0:
        raise WorldError(f"The seed of a {what} is a whole number from 0, got {seed!r}.")
    return number


def resolve_profile(
    robot: str | os.PathLike[str], steering: Steering | None, size: tuple[int, int]
) -> Profile:
    """The profile, with the steering and the size of pictures that are asked for.

    Raises:
        UnknownName: If there is no such profile or steering.
        ProfileError: If it is not the profile of a vehicle with a camera.
    """
    profile = load_profile(find_profile(robot))
    if profile.camera is None:
        raise ProfileError(f"{profile.path}: the robot has no camera, and this task needs one.")
    actions = profile.actions
    if [action.name for action in actions] != ["steering", "throttle"]:
        names = ", ".join(action.name for action in actions)
        raise ProfileError(
            f"{profile.path}: a vehicle's actions are steering and throttle, not {names}."
        )
    if steering is not None:
        if steering not in _LEVELS:
            raise UnknownName("steering", steering, _LEVELS)
        actions = (dataclasses.replace(actions[0], levels=_LEVELS[steering]), *actions[1:])
    camera = dataclasses.replace(profile.camera, size=size, flip=False)
    return dataclasses.replace(profile, actions=actions, camera=camera)


Courses = Literal["training", "held-out"] | Sequence[int]
"""Courses that vehicles learn on, those that they are judged on, or some by their seeds."""

_KINDS: Final = {"training": TRAINING, "held-out": HELD_OUT}
_OPTIONS: Final = ("course", "start")


@dataclass(frozen=True, slots=True)
class EpisodeSetup:
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
    camera: CameraJitter | None


class CourseSampler:
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
            self._seeds = tuple(check_seed("course", seed) for seed in seeds)
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

    def draw(
        self, rng: np.random.Generator, world: str, options: Mapping[str, Any]
    ) -> EpisodeSetup:
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
        camera = CameraJitter.random(rng) if self._randomise else None
        return EpisodeSetup(
            check_seed("course", options.get("course", course)),
            check_seed("start", options.get("start", start)),
            look,
            camera,
        )
