"""Place of a twin: the plain room, a finger's rig, or what another package opens."""

from __future__ import annotations

import importlib
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any

from shapechanger.contract.world import World
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.twin.world.vehicle import DrivingWorld

_ROOM = (160, 120)
"""Width and height of the pictures of a room without a camera, in pixels."""


@dataclass(frozen=True, slots=True)
class Place:
    """A world and the body in it.

    Attributes:
        opener: Function that opens the world, as "module:function"; "" for the plain room with
            boxes, which needs no simulator. It is called as `open_world`, without the place.
        arguments: Keyword arguments of the opener, as JSON holds them.
        finger: Parameters of the finger whose tendons the robot pulls, as JSON; "" for none.
    """

    opener: str = ""
    arguments: Mapping[str, Any] = field(default_factory=dict[str, Any])
    finger: str = ""


def open_world(place: Place, parts: Collection[str], camera: CameraPlan | None, seed: int) -> World:
    """Open the world of a place.

    Args:
        place: The place.
        parts: Parts that the robot's outputs move.
        camera: Camera of the profile, as which the world is shown; None without one.
        seed: Seed of the surroundings and of the start.

    Raises:
        ShapechangerError: If the opener refuses its arguments or the robot.
        FingerError: If the parameters of the finger are invalid.
        MissingExtra: If MuJoCo is needed and not installed.
    """
    if place.finger:
        from shapechanger.finger.parameters import FingerParameters
        from shapechanger.finger.twin import FingerWorld

        return FingerWorld(FingerParameters.from_json(place.finger), seed)
    if place.opener:
        module, _, name = place.opener.partition(":")
        world: World = getattr(importlib.import_module(module), name)(
            parts, camera, seed, **place.arguments
        )
        return world
    size, pitch_deg, fovy_deg = (
        (None, None, None) if camera is None else (camera.size, camera.pitch_deg, camera.fovy_deg)
    )
    return DrivingWorld(
        frozenset(parts), size or _ROOM, seed, pitch_deg=pitch_deg, fovy_deg=fovy_deg
    )
