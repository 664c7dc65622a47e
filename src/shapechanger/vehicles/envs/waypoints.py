"""One camera and one action for all vehicles: where the free way is, and how fast to go there.

Networks that predict steering learn the body with it: full left is another circle in each vehicle.
A waypoint means the same in all of them. What a body must know is how fast it turns when it steers,
two numbers that it measures itself, in seconds and without pictures.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from contextlib import closing
from functools import lru_cache, partial
from typing import Any, Final

import numpy as np
from gymnasium.utils import EzPickle
from numpy.typing import NDArray

from shapechanger.errors import ProfileError
from shapechanger.vehicles.bodies import vehicle_model
from shapechanger.vehicles.cameras.rectify import rectifier_of
from shapechanger.vehicles.courses.course import FLOODED
from shapechanger.vehicles.envs.demonstrators import Demonstrator, course_expert, require_rate
from shapechanger.vehicles.envs.drive import Courses, DriveEnv, simulated_robot
from shapechanger.vehicles.envs.ranges import RangesEnv
from shapechanger.vehicles.envs.shift import certify_vehicles
from shapechanger.vehicles.envs.vehicle import VehicleEnv
from shapechanger.vehicles.expert.driver import CourseExpert
from shapechanger.vehicles.waypoints import (
    AHEAD_M,
    WIDEST_RAD,
    SteeringResponse,
    WaypointView,
    measure_response,
    places_of_motion,
)
from shapechanger.vehicles.world import MujocoWorld

# Standard deviation of the bearing's disturbance: the effect of steering by 0.25 in the car.
_SWAY: Final = 0.18


@lru_cache(maxsize=32)
def _response_of(
    vehicle: str, world: str | None, robot: str | os.PathLike[str] | None, sensed: bool
) -> SteeringResponse:
    """Measure the response of a simulated vehicle, once in a process."""
    common: dict[str, Any] = {"world": world, "robot": robot, "courses": (0,), "put_back": True}
    env = VehicleEnv(vehicle, image=False, **common) if sensed else RangesEnv(vehicle, **common)
    with closing(env):
        profile = simulated_robot(vehicle, robot).path
        return measure_response(
            env, *places_of_motion(env, ("speed", "yaw_rate"), profile, ProfileError)
        )


class WaypointEnv(WaypointView, DriveEnv):
    """The driving task with a camera and an action that are the same for all vehicles.

    A policy that learned in one vehicle drives another one as it is: pictures are warped to one
    virtual camera (`shapechanger.vehicles.cameras.rectify`), and the action is a waypoint, which
    the vehicle turns into steering by its own `SteeringResponse`, measured when the env is made.

    ## Action space
    `Box(-1, 1, (2,), float32)`: bearing of the free way `AHEAD_M` ahead, in `WIDEST_RAD`, positive
    to the right; and the speed, -1 for standing and 1 for full throttle. It acts for one control
    period, 1/20 s.

    ## Observation space
    The rectified frame, RGB, `uint8`, shape (48, 80, 3).

    ## Reward, start, end and info
    Those of `RangesEnv`, or of `VehicleEnv` with `sensed`.

    Args:
        vehicle: "car", "tank", "boat" or "truck".
        world: "corridor", "yard", "harbour" or "flooded-corridor"; None for the corridor, flooded
            for a boat, so that vehicles differ in their bodies alone.
        robot: Path or name of a profile; None for `lab-` followed by the vehicle.
        sensed: Whether speed and reward are those that the sensors of `VehicleEnv` measure, instead
            of the true ones; its physics takes shorter steps, too.
        courses: "training" or "held-out" for the courses that `reset` samples, or their seeds.
        randomise: Whether `reset` samples light, textures and the camera's pose too. Pictures are
            warped as if the camera were in its place, so a policy sees the error of the pose.
        put_back: Whether to put the vehicle back on the lane after a collision. A collision then
            does not end the episode.
        render_mode: "rgb_array" for `render` to return the camera's picture as it is.

    Attributes:
        parts: The parts that the robot's outputs move.
        response: How the vehicle turns.

    Raises:
        UnknownName: If there is no such vehicle, world, profile or kind of courses.
        ProfileError: If the profile moves other parts than the vehicle has, or has no camera that
            sees what policies for all vehicles look at.
        WorldError: If the vehicle cannot drive in the world.
    """

    certify_shift = staticmethod(certify_vehicles)

    def __init__(
        self,
        vehicle: str,
        *,
        world: str | None = None,
        robot: str | os.PathLike[str] | None = None,
        sensed: bool = False,
        courses: Courses = "training",
        randomise: bool = False,
        put_back: bool = False,
        render_mode: str | None = None,
    ) -> None:
        arguments = {n: v for n, v in locals().items() if n not in ("self", "__class__", "vehicle")}
        EzPickle.__init__(self, vehicle, **arguments)
        body, profile = vehicle_model(vehicle), simulated_robot(vehicle, robot)
        rectifier = rectifier_of(
            profile.path, profile.camera_pitch_deg, profile.camera_fovy_deg, profile.size,
            ProfileError,
        )  # fmt: skip
        world = world or (FLOODED if body.floats else "corridor")
        common: dict[str, Any] = {
            "world": world, "robot": robot, "courses": courses, "randomise": randomise,
            "put_back": put_back, "render_mode": render_mode,
        }  # fmt: skip
        self.response = _response_of(vehicle, world, robot, sensed)
        self._env = env = (
            VehicleEnv(vehicle, state=True, **common)
            if sensed
            else RangesEnv(vehicle, camera=True, **common)
        )
        self.parts, self._world = env.parts, env.world
        self.render_mode, self.metadata = render_mode, env.metadata
        (speed_at,) = places_of_motion(env, ("speed",), profile.path, ProfileError)
        self._see(rectifier, speed_at, turns_on_the_spot=body.turning_radius_m == 0.0)

    def hold_out(self) -> None:
        """Sample held-out courses from the next reset on."""
        self._env.hold_out()

    def demonstrator(self, seed: int) -> Demonstrator:
        """Return an expert that knows the whole course and recovers from its own mistakes.

        Args:
            seed: Seed of the mistakes.

        Raises:
            ProfileError: If the robot has another control rate than the expert.
        """
        require_rate(self.metadata["render_fps"])
        return waypoint_demonstrator(self.world, seed)


def waypoint_demonstrator(world: MujocoWorld, seed: int) -> Demonstrator:
    """Return an expert whose actions are waypoints: the bearing of the free way, and the speed."""

    def begin() -> Callable[[], NDArray[np.float32]]:
        return partial(_point, world, course_expert(world))

    return Demonstrator(world, begin, seed, _SWAY)


def _point(world: MujocoWorld, expert: CourseExpert) -> NDArray[np.float32]:
    """Return the waypoint on the expert's path."""
    pose, path = world.pose, expert.path
    station = path.nearest(pose.x, pose.y).station
    x, y = path.at(station + AHEAD_M)
    left = math.remainder(math.atan2(y - pose.y, x - pose.x) - pose.heading, math.tau)
    share = expert.speeds[path.index(station)] / world.vehicle.top_speed_mps
    return np.clip((-left / WIDEST_RAD, 2.0 * share - 1.0), -1.0, 1.0).astype(np.float32)
