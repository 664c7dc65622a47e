"""What somebody asks a vehicle's env for: refused in words, or brought into form."""

from __future__ import annotations

import dataclasses
import operator
import os
from collections.abc import Sequence
from typing import Any, Final, Literal

from shapechanger.errors import ProfileError, SpaceMismatch, UnknownName, WorldError
from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.robot.profile.profile import Profile

__all__ = ["Steering", "profile_as_asked", "seed_as_asked", "size_as_asked"]

Steering = Literal["proportional", "bang"]
"""How the wheels turn: anywhere, or full left, straight and full right only, as in 2017."""

_LEVELS: Final[dict[str, Literal["any", "three"]]] = {"proportional": "any", "bang": "three"}
_LARGEST: Final = 1920  # Pixels, as in a profile.


def size_as_asked(size: Sequence[int]) -> tuple[int, int]:
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


def seed_as_asked(what: str, seed: Any) -> int:
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


def profile_as_asked(
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
