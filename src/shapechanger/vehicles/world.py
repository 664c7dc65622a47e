"""A vehicle on a course, simulated in MuJoCo."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.contract.world import RESTING_V, Pose, Readings
from shapechanger.errors import WorldError
from shapechanger.vehicles.bodies import SIM_DT, add_vehicle, vehicle_model
from shapechanger.vehicles.bodies.model import ContactTracker
from shapechanger.vehicles.bodies.parts import CameraJitter, CameraMount, aim_camera, move_camera
from shapechanger.vehicles.courses import lay_out, start_pose
from shapechanger.vehicles.courses.course import HOME, Course, Look, require_element
from shapechanger.vehicles.courses.geometry import CourseProgress
from shapechanger.vehicles.courses.scene import SOLID_GROUP, add_course

if TYPE_CHECKING:
    from shapechanger.vehicles.cameras.camera import Corruption, OnboardCamera, OutsideCamera
    from shapechanger.vehicles.expert.path import CoursePath

PORTRAITS_RAD: Final = tuple(
    math.radians(degrees) for degrees in (125.0, -125.0, 150.0, -150.0, 55.0, -55.0, 25.0, -25.0)
)
"""Directions of view for images from outside, rad from the heading, in order of preference."""

_CAMERA: Final = "vehicle/camera"
_CHASSIS: Final = "vehicle/chassis"
_INNER_OHM: Final = 0.12  # Resistance of the battery and its leads.
_IDLE_A: Final = 0.6  # Current of the computer.
_CONE: Final = np.radians((-7.0, 0.0, 7.0))  # An HC-SR04 hears 15 degrees.
_HEARD_M: Final = 10.0  # Longest ray, more than twice the range of an HC-SR04.

_SOLID: Final = (np.arange(mujoco.mjNGROUP) == SOLID_GROUP).astype(np.uint8)
_COARSE_DT: Final = 2.0 * SIM_DT
_ROUNDING_S: Final = 1e-9
# Number of cached courses: the layout takes 70 ms, and the path 60 ms; a model takes 5 MB.
_KEPT_COURSES: Final = 64
# Views from outside look down at a point of the vehicle at this height, m. At MuJoCo's field of
# view of 45 degrees a sphere of radius 1 fills the height at a distance of 2.6.
_ABOVE_RAD: Final = math.radians(-20.0)
_LOOKED_AT_M: Final = 0.06
_DISTANCE_PER_REACH: Final = 3.0
# Largest distance between two updates of the progress, m: below the limit of `CourseProgress`.
_PROGRESS_M: Final = 0.5


class MujocoWorld:
    """A vehicle on a course; see `World`.

    Args:
        vehicle: Name of the vehicle, such as "car".
        world: Kind of course, such as "corridor"; None for the vehicle's default (`HOME`).
        seed: Seed of the course and of the first start.
        size: Width and height of the camera's images, pixels; None for no camera.
        pitch_deg: Angle of the camera's axis below the horizon, degrees; None for the vehicle's.
        fovy_deg: Vertical field of view of the camera, degrees; None for the vehicle's.
        look: Light and colours; None for the usual look of the world.
        lenses: Names of camera faults; see `shapechanger.vehicles.cameras.camera`.
        coarse: Whether to double the time step, except for a vehicle that turns on the spot, and
            to ignore contacts of wheels with walls. The wider hull still touches walls.
    """

    def __init__(
        self,
        vehicle: str,
        world: str | None = None,
        seed: int = 0,
        *,
        size: tuple[int, int] | None = (160, 120),
        pitch_deg: float | None = None,
        fovy_deg: float | None = None,
        look: Look | None = None,
        lenses: Sequence[str] = (),
        coarse: bool = False,
    ) -> None:
        self.vehicle = vehicle_model(vehicle)
        self.mount = self.vehicle.camera.aimed(pitch_deg, fovy_deg)
        self._coarse = coarse
        # With the longer step, a tank would turn a fifth less, because it skids in turns.
        self._step_s = _COARSE_DT if coarse and self.vehicle.turning_radius_m > 0.0 else SIM_DT
        self._world = HOME[vehicle] if world is None else world
        self.look: Look = Look.of(self._world) if look is None else look
        self._camera: OnboardCamera | None = None
        self._outside: OutsideCamera | None = None
        self.lenses = tuple(lenses)
        self._distortions: list[Corruption] = []
        if size is not None or lenses:
            # Imported here, because cameras load OpenGL.
            from shapechanger.vehicles.cameras.camera import OnboardCamera, find_corruption

            self._camera = None if size is None else OnboardCamera(size, _CAMERA)
            self._distortions = [find_corruption(name) for name in lenses]
        self.travelled_m = 0.0  # Distance that the wheels rolled; backward counts down.
        self.placed = 0  # Number of times that the vehicle was put at a start or on its path.
        self.lay_out(seed)

    @property
    def seed(self) -> int:
        """Seed of the course."""
        return self.course.seed

    @property
    def collisions(self) -> int:
        """Number of collisions since the vehicle was placed."""
        return self._contacts.collisions

    @property
    def touches(self) -> bool:
        """Return whether the vehicle is in contact with a wall or an obstacle."""
        return self._contacts.touches

    @property
    def bumped(self) -> bool:
        """Return whether a contact presses the front bumper."""
        return self._contacts.bumped

    @property
    def progress_m(self) -> float:
        """Distance along the course since the vehicle was placed, m; backwards counts down."""
        return self._progress.update(*self._motion[:2])

    @property
    def pose(self) -> Pose:
        """Pose of the vehicle."""
        return Pose(*self._motion[:3])

    def lay_out(
        self, seed: int, look: Look | None = None, camera: CameraJitter | None = None
    ) -> None:
        """Change the course, and put the vehicle at a start; by default light and colours are kept.

        Raises a WorldError, and changes nothing, if the seed has no course or the camera would be
        off its vehicle.
        """
        look = self.look if look is None else look
        require_element(self.vehicle.name, floats=self.vehicle.floats, world=self._world)
        course, model = _compiled(
            self.vehicle.name, self._world, seed, look, self._coarse, self._step_s, self.mount
        )
        if camera is not None:
            model = copy.copy(model)
            move_camera(model, _CAMERA, camera)
        # All checks are above, so that an error leaves the world unchanged.
        self.look, self.model = look, model
        self.course: Course = course
        self.data = mujoco.MjData(self.model)
        self._bound = self.vehicle.bind(self.model, self.data)
        self._bound.set_current(*self.course.current_mps)
        self._contacts = ContactTracker(self.model)
        self._progress = CourseProgress(self.course)
        self._chassis = self.model.body(_CHASSIS).id
        self.place(seed)

    def place(self, seed: int) -> None:
        """Put the vehicle at a start, at rest."""
        self.put(start_pose(self.course, seed))

    def put(self, pose: Pose) -> None:
        """Put the vehicle at a pose, at rest, and reset its progress and collisions."""
        self._rest_at(pose)
        self._contacts.reset()
        self._progress.reset(pose.x, pose.y)

    def path(self) -> CoursePath:
        """A path around the course for this vehicle, planned on the first call."""
        return _planned(self.vehicle.name, self._world, self.course.seed)

    def put_back(self) -> None:
        """Put the vehicle on the nearest point of its path, at rest; progress keeps counting."""
        path, here = self.path(), self._motion
        i = path.index(path.nearest(here.x, here.y).station)
        x, y = path.points[i].tolist()
        self._rest_at(Pose(x, y, float(path.heading[i])))
        self._contacts.release()
        self._progress.update(x, y)

    def zero_odometer(self) -> None:
        """Reset the travelled distance, as restarting the robot does."""
        self.travelled_m = 0.0

    def truth(self) -> dict[str, float]:
        """Ground truth for evaluation: `progress_m` and `collisions`."""
        return {"progress_m": self.progress_m, "collisions": float(self.collisions)}

    def advance(self, dt_s: float, outputs: Mapping[str, float | None]) -> None:
        """Simulate for a time, in whole steps; see `World.advance`.

        Contacts and the voltage of the battery are updated once per call.
        """
        self._rest_s += dt_s
        steps = int((self._rest_s + _ROUNDING_S) / self._step_s)
        if steps:
            passed_s = steps * self._step_s
            self._rest_s -= passed_s
            bound, before = self._bound, self._motion
            bound.drive(outputs, RESTING_V - _INNER_OHM * self._current_a)
            mujoco.mj_step(self.model, self.data, nstep=steps)
            self._motion = now = bound.motion()
            self._contacts.follow(self.data, now, passed_s)
            change = now.speed - before.speed
            self._acceleration = (change / passed_s, now.speed * now.yaw_rate)
            rolled_m = bound.travelled_m()
            self.travelled_m += rolled_m - self._rolled_m
            self._rolled_m = rolled_m
            self._current_a = _IDLE_A + bound.current_a()
        here = self._motion[:2]
        if math.dist(here, self._updated_at) > _PROGRESS_M:
            self._updated_at = here
            self._progress.update(*here)

    def inputs(self) -> Readings:
        """Quantities that sensors measure."""
        x, y, heading, speed, _, yaw_rate = self._motion
        return Readings(
            pose=Pose(x, y, heading),
            speed=speed,
            travelled_m=self.travelled_m,
            acceleration_x=self._acceleration[0],
            acceleration_y=self._acceleration[1],
            yaw_rate=yaw_rate,
            bumped=self._contacts.bumped,
            battery_v=RESTING_V - _INNER_OHM * self._current_a,
            current_a=self._current_a,
        )

    def distance_m(self) -> float:
        """Distance from the nose to the nearest object ahead, by the shortest of three rays, m."""
        found = self._rays(0.0, _CONE, math.inf, _HEARD_M)
        return max(0.0, float(found.min()) - self.vehicle.nose_m)

    def ranges_m(
        self, bearings: NDArray[np.float64], farthest_m: float = 6.0
    ) -> NDArray[np.float64]:
        """Distances from the middle of the front bumper to walls and obstacles, m, (n,).

        Bearings are directions from the heading, rad, positive to the left, each from -pi/2 to
        pi/2. Distances are at most `farthest_m`.
        """
        found = self._rays(self.vehicle.nose_m, bearings, farthest_m, farthest_m)
        return np.minimum(found, farthest_m, out=found)

    def _rays(
        self, ahead_m: float, bearings: NDArray[np.float64], nothing_m: float, farthest_m: float
    ) -> NDArray[np.float64]:
        """Distances from a point ahead of the middle, m, (n,); `nothing_m` without an obstacle."""
        pose, count = self._motion, len(bearings)
        x = pose.x + ahead_m * math.cos(pose.heading)
        y = pose.y + ahead_m * math.sin(pose.heading)
        start, angles = np.array((x, y, 0.5 * self.vehicle.camera.z)), pose.heading + bearings
        rays = np.zeros((count, 3))
        rays[:, 0], rays[:, 1] = np.cos(angles), np.sin(angles)
        hit, found = np.empty(count, np.int32), np.empty(count)
        mujoco.mj_multiRay(
            self.model, self.data, start, rays.ravel(), _SOLID, True, self._chassis, hit,
            found, None, count, farthest_m,
        )  # fmt: skip
        found[(hit < 0) | (found < 0.0)] = nothing_m
        return found

    def picture(self) -> NDArray[np.uint8]:
        """Image of the front camera, RGB, shape (height, width, 3)."""
        if self._camera is None:
            raise WorldError("This world has no camera: pass a `size`.")
        image = self._camera.picture(self.model, self.data)
        for distort in self._distortions:
            image = distort(image, self.course.seed)
        return image

    @property
    def reach(self) -> float:
        """Distance from the middle of the vehicle, trailer included, to its farthest point, m."""
        return 0.5 * math.hypot(self.vehicle.length_m, self.vehicle.width_m)

    def outside(
        self,
        width: int = 480,
        height: int = 360,
        reach: float | None = None,
        *,
        azimuth_rad: float | Sequence[float] = PORTRAITS_RAD,
        elevation_rad: float = _ABOVE_RAD,
    ) -> NDArray[np.uint8]:
        """Image of the vehicle in its world from outside, (height, width, 3).

        `reach` is the radius in view around the middle of the vehicle, m, by default its own reach.
        The azimuth is the direction of view from the heading, counter-clockwise; 0 is from behind.
        Of several directions, the first in which nothing hides the vehicle is used, or else the
        first. A negative elevation looks down.
        """
        if self._outside is None or self._outside.size != (width, height):
            from shapechanger.vehicles.cameras.camera import OutsideCamera  # OpenGL.

            camera = OutsideCamera((width, height))
            if self._outside is not None:
                self._outside.close()
            self._outside = camera
        x, y, heading = self._motion[:3]
        ahead = np.array((math.cos(heading), math.sin(heading), 0.0))
        middle = self.vehicle.nose_m - 0.5 * self.vehicle.length_m
        centre = np.array((x, y, _LOOKED_AT_M)) + middle * ahead
        distance = _DISTANCE_PER_REACH * (reach or self.reach)
        views = [heading + azimuth for azimuth in np.atleast_1d(azimuth_rad).tolist()]
        ends = centre + 0.5 * self.vehicle.length_m * np.stack([-ahead, ahead])

        def sees(view: float) -> bool:
            """Return whether neither nose nor tail is behind a wall or an obstacle."""
            flat, rise = math.cos(elevation_rad), math.sin(elevation_rad)
            eye = centre - distance * np.array((flat * math.cos(view), flat * math.sin(view), rise))
            model, hit = self.model, np.zeros(1, np.int32)
            for end in ends:
                away = end - eye
                met = mujoco.mj_ray(model, self.data, eye, away, _SOLID, True, self._chassis, hit)
                if 0.0 <= met < 1.0 and model.geom_bodyid[hit[0]] == 0:  # In lengths of the ray.
                    return False
            return True

        view = next(filter(sees, views), views[0])
        return self._outside.picture(self.model, self.data, centre, distance, view, elevation_rad)

    def close(self) -> None:
        """Free the cameras' OpenGL contexts."""
        for camera in (self._camera, self._outside):
            if camera is not None:
                camera.close()
        self._camera = self._outside = None

    def _rest_at(self, pose: Pose) -> None:
        self.placed += 1
        mujoco.mj_resetData(self.model, self.data)
        self._bound.place(pose.x, pose.y, pose.heading)
        mujoco.mj_forward(self.model, self.data)
        self._motion = self._bound.motion()
        self._updated_at = pose.x, pose.y
        self._rest_s = 0.0
        self._acceleration = (0.0, 0.0)
        self._rolled_m = self._bound.travelled_m()
        self._current_a = _IDLE_A


@lru_cache(maxsize=_KEPT_COURSES)
def _compiled(
    vehicle: str, world: str, seed: int, look: Look, coarse: bool, step_s: float, mount: CameraMount
) -> tuple[Course, mujoco.MjModel]:
    """Return a course, and the compiled model of a vehicle on it; neither may be changed."""
    course = lay_out(world, seed)
    spec = mujoco.MjSpec()
    add_course(spec, course, look)
    add_vehicle(spec, vehicle, look.tone())
    aim_camera(spec.camera(_CAMERA), mount)
    spec.option.timestep = step_s
    ground = spec.geom("world/ground")
    for geom in spec.geoms if coarse else ():
        # Pair wheels with the ground only: to search for all contacts takes a third of a step.
        if geom.contype & ground.conaffinity and geom.name.startswith("vehicle/"):
            geom.contype = geom.conaffinity = 0
            # MuJoCo's rule for combining the frictions of two geoms.
            wins = geom.priority > ground.priority
            slide, spin, roll = (
                geom.friction if wins else np.maximum(geom.friction, ground.friction)
            )
            friction = [slide, slide, spin, roll, roll]
            spec.add_pair(geomname1=ground.name, geomname2=geom.name, friction=friction)
    return course, spec.compile()


@lru_cache(maxsize=_KEPT_COURSES)
def _planned(vehicle: str, world: str, seed: int) -> CoursePath:
    """Return a path around a course for a vehicle."""
    from shapechanger.vehicles.expert.driver import plan_path_for, traits_of  # SciPy.

    return plan_path_for(lay_out(world, seed), traits_of(vehicle))
