"""A vehicle on a course, in MuJoCo."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.bodies.vehicles import SIM_DT, add_vehicle, vehicle_model
from shapechanger.errors import WorldError
from shapechanger.worlds.camera import CameraJitter, OnboardCamera, move_camera
from shapechanger.worlds.course import HOME, Course, require_element
from shapechanger.worlds.expert.line import CourseProgress
from shapechanger.worlds.expert.path import CoursePath, plan_path_for
from shapechanger.worlds.expert.traits import traits_of
from shapechanger.worlds.layout import lay_out, start_pose
from shapechanger.worlds.lens import lens
from shapechanger.worlds.look import Look
from shapechanger.worlds.scene import add_course
from shapechanger.worlds.world import RESTING_V, Pose, Readings

__all__ = ["MujocoWorld", "Touch"]

BUMPER_SPREAD: Final = math.radians(60.0)
"""How far to each side the bumper at the front reaches, seen from the middle of the vehicle."""

APART_S: Final = 0.5
"""A touch within so many seconds after the last one belongs to the same collision."""


class Touch:
    """Follows what a vehicle touches.

    Args:
        model: The model; the vehicle's geoms are named "vehicle/...", walls and things
            "world/wall/..." and "world/thing/...".

    Attributes:
        collisions: How many times it ran into something since `reset`.
        bumped: Whether something presses its front now.
        touches: Whether it touches anything now.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        names = [model.geom(i).name for i in range(model.ngeom)]
        self._hull = np.array([name.startswith("vehicle/") for name in names])
        self._solid = np.array([name.startswith(("world/wall", "world/thing")) for name in names])
        self.reset()

    def reset(self) -> None:
        """Forget what was touched."""
        self.collisions = 0
        self.let_go()

    def let_go(self) -> None:
        """The vehicle was lifted off whatever it touched: what comes next is another collision."""
        self.bumped = self.touches = False
        self._since_s = math.inf

    def follow(self, data: mujoco.MjData, pose: Pose, dt_s: float) -> None:
        """Take in the contacts after a step of the simulation.

        Args:
            data: With the contacts.
            pose: Of the vehicle.
            dt_s: How long the step was, s.
        """
        self._since_s += dt_s
        self.bumped = self.touches = False
        if data.ncon == 0:
            return
        pairs = data.contact.geom
        if not self._solid[pairs].any():
            return  # As nearly always: wheels are on the ground, and nothing else is touched.
        first, second = pairs[:, 0], pairs[:, 1]
        hits = (self._hull[first] & self._solid[second]) | (self._hull[second] & self._solid[first])
        hits &= data.contact.dist <= 0.0
        if not hits.any():
            return
        self.touches = True
        if self._since_s > APART_S:
            self.collisions += 1
        self._since_s = 0.0
        for x, y, _ in data.contact.pos[hits]:
            bearing = math.atan2(y - pose.y, x - pose.x) - pose.heading
            self.bumped |= abs(math.remainder(bearing, math.tau)) <= BUMPER_SPREAD


_CAMERA: Final = "vehicle/camera"
_CHASSIS: Final = "vehicle/chassis"
_INNER_OHM: Final = 0.12  # Of the battery and its leads.
_IDLE_A: Final = 0.6  # What the computer takes.
_CONE: Final = (-math.radians(7.0), 0.0, math.radians(7.0))  # An HC-SR04 hears 15 degrees.
_SOLID_GROUP: Final = 3  # Of the geoms that stop a vehicle; see `shapechanger.worlds.scene`.
_ROUNDING_S: Final = 1e-9


class MujocoWorld:
    """A vehicle on a course; see `World`.

    Args:
        vehicle: Name of the vehicle, such as "car".
        world: Kind of place, such as "corridor"; None for where the vehicle is at home.
        seed: Of the course and of the first start.
        size: Width and height of the pictures in pixels; None for no pictures.
        look: How it looks; None for how such a place usually does.
        lenses: What is wrong with the camera, see `shapechanger.worlds.lens`.

    Attributes:
        course: The course.
        look: How it looks.
        lenses: Names of what is wrong with the camera.
        model: The compiled model.
        data: Its state.
        resting_v: Voltage of the battery without load.

    Raises:
        UnknownName: If there is no such vehicle, place or lens.
        WorldError: If the vehicle does not fit the place.
    """

    def __init__(
        self,
        vehicle: str,
        world: str | None = None,
        seed: int = 0,
        *,
        size: tuple[int, int] | None = (160, 120),
        look: Look | None = None,
        lenses: Sequence[str] = (),
    ) -> None:
        self.vehicle = vehicle_model(vehicle)
        self._world = HOME[vehicle] if world is None else world
        self.look: Look = Look.of(self._world) if look is None else look
        self._camera = None if size is None else OnboardCamera(size)
        self.lenses = tuple(lenses)
        self._distortions = [lens(name) for name in lenses]
        self.resting_v = RESTING_V
        self._travelled_m = 0.0
        self.lay_out(seed)

    @property
    def seed(self) -> int:
        """What the course follows from."""
        return self.course.seed

    @property
    def collisions(self) -> int:
        """How many times the vehicle ran into something since it was placed."""
        return self._touch.collisions

    @property
    def touches(self) -> bool:
        """Whether the vehicle touches anything now."""
        return self._touch.touches

    @property
    def progress_m(self) -> float:
        """How far it came along the course since it was placed, m; backwards counts down."""
        return self._progress.metres

    @property
    def pose(self) -> Pose:
        """Where the vehicle is."""
        return self._bound.pose()

    def lay_out(
        self, seed: int, look: Look | None = None, camera: CameraJitter | None = None
    ) -> None:
        """Another course, with the vehicle at a start; see `World.lay_out`.

        Args:
            seed: What the course follows from.
            look: How it looks from now on; None for as before.
            camera: How far its camera is off its place.

        Raises:
            WorldError: If no course belongs to the seed, or the camera is off its vehicle.
        """
        look = self.look if look is None else look
        course = lay_out(self._world, seed)
        require_element(self.vehicle.name, floats=self.vehicle.floats, world=self._world)
        spec = mujoco.MjSpec()
        add_course(spec, course, look)
        add_vehicle(spec, self.vehicle.name)
        model = spec.compile()
        if camera is not None:
            move_camera(model, _CAMERA, camera)
        # Whatever is refused is refused above, and leaves the world as it was.
        self.look, self.model = look, model
        self.course: Course = course
        self.data = mujoco.MjData(self.model)
        self._bound = self.vehicle.bind(self.model, self.data)
        self._bound.set_current(*self.course.current_mps)
        self._touch = Touch(self.model)
        self._progress = CourseProgress(self.course)
        self._path: CoursePath | None = None
        self._chassis = self.model.body(_CHASSIS).id
        self._solid = np.zeros(mujoco.mjNGROUP, np.uint8)
        self._solid[_SOLID_GROUP] = 1
        if self._camera is not None:
            self._camera.look_through(self.model, _CAMERA)
        self.place(seed)

    def place(self, seed: int) -> None:
        """Put the vehicle at a start, at rest; see `World.place`."""
        self.put(start_pose(self.course, seed))

    def put(self, pose: Pose) -> None:
        """Put the vehicle somewhere, at rest, and count its progress and collisions from there."""
        self._rest_at(pose)
        self._touch.reset()
        self._progress.reset(pose.x, pose.y)

    def path(self) -> CoursePath:
        """A way round the course for this vehicle; planned when it is first asked for.

        Raises:
            WorldError: If there is none.
        """
        if self._path is None:
            self._path = plan_path_for(self.course, traits_of(self.vehicle.name))
        return self._path

    def put_back(self) -> None:
        """Put the vehicle back on a free line where it is, as a person would who walks beside it.

        Progress and collisions go on counting.

        Raises:
            WorldError: If there is no way round the course for this vehicle.
        """
        path, here = self.path(), self._bound.pose()
        i = path.index(path.nearest(here.x, here.y).station)
        x, y = path.points[i]
        self._rest_at(Pose(float(x), float(y), float(path.heading[i])))
        self._touch.let_go()
        self._progress.update(float(x), float(y))

    def zero_odometer(self) -> None:
        """Count what the wheels roll from 0, for a robot that is switched on anew."""
        self._travelled_m = 0.0

    def truth(self) -> dict[str, float]:
        """`progress_m` and `collisions`; see `World.truth`."""
        return {"progress_m": self.progress_m, "collisions": float(self.collisions)}

    def advance(self, dt_s: float, outputs: Mapping[str, float | None]) -> None:
        """Let time go by, in whole steps of the simulation; see `World.advance`."""
        self._rest_s += dt_s
        while self._rest_s >= SIM_DT - _ROUNDING_S:
            self._rest_s -= SIM_DT
            self._step(outputs)
        pose = self._bound.pose()
        self._progress.update(pose.x, pose.y)

    def inputs(self) -> Readings:
        """What sensors could measure now; see `World.inputs`."""
        bound = self._bound
        return Readings(
            pose=bound.pose(),
            speed=bound.speed(),
            travelled_m=self._travelled_m,
            acceleration_x=self._acceleration[0],
            acceleration_y=self._acceleration[1],
            yaw_rate=bound.yaw_rate(),
            bumped=self._touch.bumped,
            battery_v=self._battery_v,
            current_a=self._current_a,
        )

    def distance_m(self) -> float:
        """The shortest of three rays from the nose; see `World.distance_m`."""
        pose = self._bound.pose()
        height = 0.5 * self.vehicle.camera.z
        start = np.array((pose.x, pose.y, height))
        hit = np.zeros(1, np.int32)
        found = math.inf
        for angle in _CONE:
            ray = np.array((math.cos(pose.heading + angle), math.sin(pose.heading + angle), 0.0))
            distance = mujoco.mj_ray(
                self.model, self.data, start, ray, self._solid, True, self._chassis, hit
            )
            if distance >= 0.0:
                found = min(found, distance)
        return max(0.0, found - self.vehicle.nose_m)

    def picture(self) -> NDArray[np.uint8]:
        """What the front camera sees; see `World.picture`.

        Raises:
            WorldError: If it was made without a camera.
        """
        if self._camera is None:
            raise WorldError("This world was made without a camera: give it a `size`.")
        picture = self._camera.picture(self.model, self.data)
        for distort in self._distortions:
            picture = distort(picture, self.course.seed)
        return picture

    def close(self) -> None:
        """Free what draws."""
        if self._camera is not None:
            self._camera.close()
            self._camera = None

    def _rest_at(self, pose: Pose) -> None:
        mujoco.mj_resetData(self.model, self.data)
        self._bound.place(pose.x, pose.y, pose.heading)
        mujoco.mj_forward(self.model, self.data)
        self._rest_s = 0.0
        self._speed = 0.0
        self._acceleration = (0.0, 0.0)
        self._rolled_m = self._bound.travelled_m()
        self._current_a = _IDLE_A

    @property
    def _battery_v(self) -> float:
        return self.resting_v - _INNER_OHM * self._current_a

    def _step(self, outputs: Mapping[str, float | None]) -> None:
        bound = self._bound
        bound.drive(outputs, self._battery_v)
        mujoco.mj_step(self.model, self.data)
        pose = bound.pose()
        self._touch.follow(self.data, pose, SIM_DT)
        speed = bound.speed()
        self._acceleration = ((speed - self._speed) / SIM_DT, speed * bound.yaw_rate())
        self._speed = speed
        rolled_m = bound.travelled_m()
        self._travelled_m += rolled_m - self._rolled_m
        self._rolled_m = rolled_m
        self._current_a = _IDLE_A + bound.current_a()
