"""Simulated courses for a robot's twin, and what simulations need of its profile."""

from __future__ import annotations

import os
from collections.abc import Collection, Sequence
from typing import Any

from shapechanger.contract.world import World
from shapechanger.errors import ProfileError, UnknownName, needing_extra
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.twin.start import Place
from shapechanger.vehicles.courses import WORLDS
from shapechanger.vehicles.courses.course import HOME, require_element

with needing_extra("sim"):
    from shapechanger.vehicles.bodies import VEHICLES, require_fit
    from shapechanger.vehicles.cameras.camera import find_corruption
    from shapechanger.vehicles.envs.drive import SimulatedRobot
    from shapechanger.vehicles.world import MujocoWorld

ROOM = "room"
"""Name of the world that is a plain room for any robot."""


def read_robot(robot: str | os.PathLike[str]) -> SimulatedRobot:
    """Read the part of a robot's profile that its simulation needs."""
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
        camera_deg=(None, None) if camera is None else (camera.pitch_deg, camera.fovy_deg),
    )


def place_of(profile: Profile, world: str = "", lenses: Sequence[str] = ()) -> Place:
    """Return the place of a robot's twin: a course with these camera faults, or the plain room.

    `world` is a kind of course; by default a vehicle's home, or for any other robot the plain room.
    """
    for lens in lenses:
        find_corruption(lens)
    parts = {output.part for output in profile.outputs if output.part}
    if not world:
        try:
            require_fit(profile.body, parts)
        except (ProfileError, UnknownName):
            if lenses:  # The plain room has no camera whose faults they are.
                raise
            return Place()
        return course_place(HOME[profile.body], profile.body, lenses)
    if world not in WORLDS:
        raise UnknownName("world", world, (ROOM, *WORLDS))
    if profile.body not in VEHICLES:
        raise ProfileError(
            f"{profile.path}: there is no {profile.body} in MuJoCo, only {', '.join(VEHICLES)}; "
            f"--world {ROOM} works for any robot."
        )
    require_fit(profile.body, parts)
    require_element(profile.body, floats=VEHICLES[profile.body].floats, world=world)
    return course_place(world, profile.body, lenses)


def course_place(world: str, vehicle: str, lenses: Sequence[str] = ()) -> Place:
    """Return a place that the twin's board process opens with `open_course`."""
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
    """Open a course with a vehicle on it."""
    require_fit(vehicle, parts)
    seen: dict[str, Any] = {"size": None}
    if camera is not None:
        seen = {"size": camera.size, "pitch_deg": camera.pitch_deg, "fovy_deg": camera.fovy_deg}
    return MujocoWorld(vehicle, world, seed, lenses=lenses, **seen)
