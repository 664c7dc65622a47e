"""Courses in MuJoCo as places of a robot's twin."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from shapechanger.contract.world import World
from shapechanger.errors import MissingExtra
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.twin.world.place import Place


def course_place(world: str, vehicle: str, lenses: Sequence[str] = ()) -> Place:
    """Return a place that the process of a twin's board opens by `open_course`.

    Args:
        world: Kind of course, such as "corridor".
        vehicle: Vehicle on it, such as "car".
        lenses: Corruptions of the camera; see `shapechanger.vehicles.cameras.corruptions`.
    """
    arguments = {"world": world, "vehicle": vehicle, "lenses": list(lenses)}
    return Place(f"{__name__}:{open_course.__name__}", arguments)


def open_course(
    parts: Collection[str],
    camera: CameraPlan | None,
    seed: int,
    *,
    world: str,
    vehicle: str,
    lenses: Sequence[str],
) -> World:
    """Open a course with a vehicle on it.

    Args:
        parts: Parts that the robot's outputs move.
        camera: Camera of the profile, as which the world is shown; None without one.
        seed: Seed of the course and of the start.
        world: Kind of course.
        vehicle: The vehicle.
        lenses: Corruptions of the camera.

    Raises:
        UnknownName: If there is no such course, vehicle or corruption.
        ProfileError: If the vehicle has other parts.
        WorldError: If the vehicle cannot drive there.
        MissingExtra: If MuJoCo is not installed.
    """
    try:
        from shapechanger.vehicles.bodies import require_fit
        from shapechanger.vehicles.world import MujocoWorld
    except ModuleNotFoundError as error:
        raise MissingExtra(error.name or "mujoco", "sim") from error

    require_fit(vehicle, parts)
    return MujocoWorld(
        vehicle,
        world,
        seed,
        size=None if camera is None else camera.size,
        pitch_deg=None if camera is None else camera.pitch_deg,
        fovy_deg=None if camera is None else camera.fovy_deg,
        lenses=tuple(lenses),
    )
