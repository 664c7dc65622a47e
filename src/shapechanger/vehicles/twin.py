"""Courses in MuJoCo as places of a robot's twin, and the numbers of robots for simulations."""

from __future__ import annotations

import os
from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

from shapechanger.contract.world import World
from shapechanger.errors import MissingExtra
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.robot.twin.start import Place

if TYPE_CHECKING:
    from shapechanger.vehicles.envs.drive import SimulatedRobot


def read_robot(robot: str | os.PathLike[str]) -> SimulatedRobot:
    """Read the numbers of a robot that its simulation needs."""
    from shapechanger.vehicles.envs.drive import SimulatedRobot

    profile = load_profile(find_profile(robot))
    camera = profile.camera
    return SimulatedRobot(
        robot=profile.name,
        body=profile.body,
        path=str(profile.path),
        plan=profile.guard_plan(),
        control_hz=profile.control_hz,
        reward=profile.reward,
        action_layout=profile.action_layout(),
        state_layout=profile.state_layout(),
        size=(0, 0) if camera is None else camera.size,
        camera_pitch_deg=None if camera is None else camera.pitch_deg,
        camera_fovy_deg=None if camera is None else camera.fovy_deg,
    )


def course_place(world: str, vehicle: str, lenses: Sequence[str] = ()) -> Place:
    """Return a place that the process of a twin's board opens by `open_course`."""
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
