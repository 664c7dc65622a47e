"""Where the vehicle of a twin is: the plain room of this package, or a place in MuJoCo."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from shapechanger.errors import MissingExtra
from shapechanger.twin.world.vehicle import DrivingWorld
from shapechanger.worlds.world import World

__all__ = ["ROOM", "Place", "open_world"]

ROOM = (160, 120)
"""Size of the pictures of a room that nobody looks at."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where a vehicle is.

    Attributes:
        world: Kind of place, such as "corridor", for which MuJoCo is needed; "" for a plain room
            with boxes in it, which needs nothing.
        vehicle: What drives there, such as "car"; in the room it follows from the parts.
        lenses: What is wrong with the camera, see `shapechanger.worlds.lens`.
        finger: Parameters of the finger whose tendons the robot pulls, as JSON; "" for none.
    """

    world: str = ""
    vehicle: str = ""
    lenses: tuple[str, ...] = ()
    finger: str = ""


def open_world(
    place: Place, parts: Collection[str], size: tuple[int, int] | None, seed: int
) -> World:
    """The world at a place.

    Args:
        place: Where.
        parts: What the robot's outputs move.
        size: Width and height of the pictures in pixels; None for no camera.
        seed: Of what stands there, and of the start.

    Raises:
        UnknownName: If there is no such place, vehicle or lens.
        ProfileError: If the vehicle has other parts.
        WorldError: If the vehicle cannot drive there.
        MissingExtra: If MuJoCo is needed and not installed.
        FingerError: If the parameters of the finger are none.
    """
    if place.finger:
        try:
            from shapechanger.bodies.finger import FingerParameters
            from shapechanger.twin.world.finger import FingerWorld
        except ModuleNotFoundError as error:
            raise MissingExtra(error.name or "mujoco", "sim") from error
        return FingerWorld(FingerParameters.from_json(place.finger), seed)
    if not place.world:
        return DrivingWorld(frozenset(parts), size or ROOM, seed)
    try:
        from shapechanger.bodies.vehicles import require_fit
        from shapechanger.worlds.simulation import MujocoWorld
    except ModuleNotFoundError as error:
        raise MissingExtra(error.name or "mujoco", "sim") from error

    require_fit(place.vehicle, parts)
    return MujocoWorld(place.vehicle, place.world, seed, size=size, lenses=place.lenses)
