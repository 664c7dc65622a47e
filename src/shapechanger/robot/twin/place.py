"""Place of a twin: the plain room, or a world that a product opens."""

from __future__ import annotations

import importlib
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any

from shapechanger.contract.world import World
from shapechanger.errors import RobotError, UnknownName
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.twin.room import DrivingWorld

_ROOM = (160, 120)
"""Width and height of the frames of a room without a camera, in pixels."""


@dataclass(frozen=True, slots=True)
class Place:
    """A world and the body in it.

    Attributes:
        opener: Function that opens the world, as "module:function"; "" for the plain room, which
            needs no simulator. It is called as `open_world`, without the place.
        arguments: Keyword arguments of the opener, as JSON holds them.
    """

    opener: str = ""
    arguments: Mapping[str, Any] = field(default_factory=dict[str, Any])


def open_world(place: Place, parts: Collection[str], camera: CameraPlan | None, seed: int) -> World:
    """Open the world of a place.

    Args:
        place: The place.
        parts: Parts that the robot's outputs move.
        camera: Camera of the profile, as which the world is shown; None without one.
        seed: Seed of the surroundings and of the start.

    Raises:
        UnknownName: If the module of the opener has no such function.
        RobotError: If there is no such module.
        ShapechangerError: If the opener refuses its arguments or the robot, or needs an extra.
    """
    if not place.opener:
        if camera is None:
            return DrivingWorld(parts, _ROOM, seed)
        angles = {"pitch_deg": camera.pitch_deg, "fovy_deg": camera.fovy_deg}
        return DrivingWorld(parts, camera.size or _ROOM, seed, **angles)
    module, _, name = place.opener.partition(":")
    try:
        found = importlib.import_module(module)
    except ModuleNotFoundError as error:
        raise RobotError(
            f"The world of this twin is opened by {place.opener}, and there is no "
            f"{error.name}: install the package that names it."
        ) from error
    if not hasattr(found, name):
        known = [other for other in vars(found) if other.startswith("open_")]
        raise UnknownName(f"function of {module} that opens a world", name, known)
    world: World = getattr(found, name)(parts, camera, seed, **place.arguments)
    return world
