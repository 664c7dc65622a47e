"""Place of a twin: the plain room, a finger's rig, or a course in MuJoCo."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from shapechanger.contract.world import World
from shapechanger.errors import MissingExtra
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.twin.world.vehicle import DrivingWorld

_ROOM = (160, 120)
"""Width and height of the pictures of a room without a camera, in pixels."""


@dataclass(frozen=True, slots=True)
class Place:
    """A world and the body in it.

    Attributes:
        world: Kind of course in MuJoCo, such as "corridor"; "" for the plain room with boxes, which
            needs no simulator.
        vehicle: Vehicle on a course, such as "car"; in the room it follows from the parts.
        lenses: Defects of the camera; see `shapechanger.worlds.lens`.
        finger: Parameters of the finger whose tendons the robot pulls, as JSON; "" for none.
    """

    world: str = ""
    vehicle: str = ""
    lenses: tuple[str, ...] = ()
    finger: str = ""


def open_world(place: Place, parts: Collection[str], camera: CameraPlan | None, seed: int) -> World:
    """Open the world of a place.

    Args:
        place: The place.
        parts: Parts that the robot's outputs move.
        camera: Camera of the profile, as which the world is shown; None without one.
        seed: Seed of the surroundings and of the start.

    Raises:
        UnknownName: If there is no such course, vehicle or lens.
        ProfileError: If the vehicle has other parts.
        WorldError: If the vehicle cannot drive there.
        MissingExtra: If MuJoCo is needed and not installed.
        FingerError: If the parameters of the finger are invalid.
    """
    if place.finger:
        from shapechanger.finger.parameters import FingerParameters
        from shapechanger.finger.twin import FingerWorld

        return FingerWorld(FingerParameters.from_json(place.finger), seed)
    size, pitch_deg, fovy_deg = (
        (None, None, None) if camera is None else (camera.size, camera.pitch_deg, camera.fovy_deg)
    )
    if not place.world:
        return DrivingWorld(
            frozenset(parts), size or _ROOM, seed, pitch_deg=pitch_deg, fovy_deg=fovy_deg
        )
    try:
        from shapechanger.bodies.vehicles import require_fit
        from shapechanger.worlds.simulation import MujocoWorld
    except ModuleNotFoundError as error:
        raise MissingExtra(error.name or "mujoco", "sim") from error

    require_fit(place.vehicle, parts)
    return MujocoWorld(
        place.vehicle,
        place.world,
        seed,
        size=size,
        pitch_deg=pitch_deg,
        fovy_deg=fovy_deg,
        lenses=place.lenses,
    )
