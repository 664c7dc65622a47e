"""The driving task on a simulated course: the base class of the envs for vehicles."""

from __future__ import annotations

import dataclasses
import functools
import json
import operator
import os
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal, Self

import gymnasium as gym
import msgspec
import numpy as np
from gymnasium.utils import EzPickle
from numpy.typing import NDArray

from shapechanger.contract.drive_reward import DriveReward
from shapechanger.contract.pages import Page
from shapechanger.contract.plan import GuardPlan
from shapechanger.errors import (
    ProfileError,
    RenderError,
    SpaceMismatch,
    WorldError,
    check_seed,
    require_known,
)
from shapechanger.layout import Layout
from shapechanger.registry import ROBOTS
from shapechanger.vehicles.bodies import require_fit, vehicle_model
from shapechanger.vehicles.bodies.parts import CameraJitter
from shapechanger.vehicles.courses.course import HELD_OUT, TRAINING, Look
from shapechanger.vehicles.world import MujocoWorld

if TYPE_CHECKING:
    from shapechanger.vehicles.envs.demonstrators import Demonstrator, ExpertDriver

Steering = Literal["proportional", "bang"]
"""Steering angles: any, or only full left, straight and full right, like the car of 2017."""

_LEVELS: Final[dict[str, Literal["any", "three"]]] = {"proportional": "any", "bang": "three"}
_MAX_PIXELS: Final = 1920  # Limit of a profile.


class SimulatedRobot(msgspec.Struct, frozen=True):
    """The part of a robot's profile that its simulation and recordings need."""

    robot: str  # Name of the profile.
    body: str  # Kind of vehicle.
    path: str  # File of the profile, for messages.
    plan: GuardPlan
    control_hz: float  # Actions per second.
    reward: dict[str, float]  # Weights of the task.
    action_layout: Layout
    state_layout: Layout
    size: tuple[int, int]  # Width and height of frames, pixels; (0, 0) without a camera.
    # Angle of the camera's axis below the horizon, and vertical field of view, degrees, if known.
    camera_deg: tuple[float | None, float | None]


@functools.cache
def lab_robots() -> dict[str, SimulatedRobot]:
    """Return the robots of the envs, keyed by the name of their profile.

    `scripts/lab_robots.py` copies their numbers from the profiles: a simulation loads no module for
    real robots.
    """
    text = Path(__file__).with_name("lab_robots.json").read_text("utf-8")
    return msgspec.convert(json.loads(text), dict[str, SimulatedRobot])


def simulated_robot(
    vehicle: str,
    robot: str | os.PathLike[str] | None,
    size: Sequence[int] | None = None,
    steering: Steering | None = None,
) -> SimulatedRobot:
    """Return the robot of a vehicle, checked against the driving task.

    `robot` is the path or name of its profile; None for `lab-` followed by the vehicle. `size`,
    pixels, and `steering` replace the profile's.
    """
    vehicle_model(vehicle)  # First, so that an unknown vehicle is not called a missing profile.
    named = f"lab-{vehicle}" if robot is None else os.fspath(robot)
    found = lab_robots().get(named) or ROBOTS.load("profile")(named)
    plan: GuardPlan = found.plan
    if found.size == (0, 0):
        raise ProfileError(f"{found.path}: the robot has no camera, and this task needs one.")
    names = [action.name for action in plan.actions]
    if names != ["steering", "throttle"]:
        raise ProfileError(f"{found.path}: actions must be steering and throttle, not {names}.")
    if steering is not None:
        require_known("steering", _LEVELS, steering)
        turning = dataclasses.replace(plan.actions[0], levels=_LEVELS[steering])
        plan = dataclasses.replace(plan, actions=(turning, *plan.actions[1:]))
    require_fit(vehicle, {output.part for output in plan.outputs})
    try:
        wide, high = map(operator.index, found.size if size is None else size)
    except (TypeError, ValueError):
        wide = high = 0
    if not (1 <= wide <= _MAX_PIXELS and 1 <= high <= _MAX_PIXELS):
        raise SpaceMismatch(
            f"The size of a frame is its width and height, each 1 to {_MAX_PIXELS} pixels, "
            f"got {size}."
        )
    return msgspec.structs.replace(found, plan=plan, size=(wide, high))


Courses = Literal["training", "held-out"] | Sequence[int]
"""Courses for training, held-out courses for evaluation, or the seeds of courses."""

_KINDS: Final = {"training": TRAINING, "held-out": HELD_OUT}
_OPTIONS: Final = ("course", "start")


def _course_seeds(courses: Courses) -> Sequence[int]:
    """Return the seeds of the courses to sample from."""
    if isinstance(courses, str):
        require_known("kind of courses", _KINDS, courses)
        return _KINDS[courses]
    given: Any = courses  # May also be a single seed.
    seeds = tuple(_seed_of("course", seed) for seed in np.atleast_1d(np.array(given, object)))
    if not seeds:
        raise WorldError("There are no courses to draw from: give at least one seed.")
    return seeds


def _seed_of(kind: str, seed: Any) -> int:
    return check_seed(seed, WorldError, f"The seed of a {kind} must be", largest=None)


class DriveEnv(Page, gym.Env[Any, NDArray[np.float32]], EzPickle):
    """The driving task: a vehicle on sampled courses, within its robot's limits.

    ## Action space
    `Box(-1, 1, (2,), float32)`; -1 steers left, +1 drives forward. An action lasts one control
    period of the profile, 1/20 s.

    | Num | Action     | Min | Max | Unit |
    | --- | ---------- | --- | --- | ---- |
    | 0   | `steering` | -1  | 1   | 1    |
    | 1   | `throttle` | -1  | 1   | 1    |

    ## Start
    At a random place of a course that the seed draws, looking along it, at rest.

    ## Info
    `progress`, metres along the course since the start; `collisions` of any part of the vehicle
    since the start, even if no bumper detects them; `pose`, (x, y, heading) in m and rad; `course`,
    the seed of the course; `standing`, whether the vehicle neither moves nor turns; and after a
    step `reward_terms`, whose terms are also keys of `info`.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 20}  # noqa: RUF012
    parts: frozenset[str]  # Parts that the robot's outputs move, such as "wheels".
    action_layout: Layout
    world: MujocoWorld  # The simulated world, with its ground truth.

    def __new__(cls, *arguments: Any, **options: Any) -> Self:
        """Store the arguments for pickling."""
        env = super().__new__(cls)
        EzPickle.__init__(env, *arguments, **options)
        return env

    def __init__(
        self,
        robot: SimulatedRobot,
        vehicle: str,
        reward: Mapping[str, float],
        *,
        has_camera: bool,
        coarse: bool = False,
        world: str | None = None,
        courses: Courses = "training",
        randomise: bool = False,
        put_back: bool = False,
        lenses: Sequence[str] = (),
        render_mode: str | None = None,
    ) -> None:
        """Open the world; see `VehicleEnv` for the arguments."""
        if render_mode is not None:
            require_known("render mode", self.metadata["render_modes"], render_mode)
        self.render_mode, self._puts_back = render_mode, put_back
        self._seeds, self._randomise = _course_seeds(courses), randomise
        pitch_deg, fovy_deg = robot.camera_deg
        self.world = MujocoWorld(
            vehicle, world, self._seeds[0], size=robot.size if has_camera or render_mode else None,
            pitch_deg=pitch_deg, fovy_deg=fovy_deg, coarse=coarse,
            lenses=(lenses,) if isinstance(lenses, str) else tuple(lenses),
        )  # fmt: skip
        self.parts = frozenset(output.part for output in robot.plan.outputs)
        ends = {"collision_ends_episode": 0.0} if put_back else {}
        self._reward = DriveReward.from_weights({**reward, **ends})
        self.action_layout = robot.action_layout
        self.action_space = space_of(self.action_layout)
        self.metadata = {**self.metadata, "render_fps": robot.control_hz}
        self._needs_reset = True

    def hold_out(self) -> None:
        """Sample held-out courses from the next reset on."""
        self._seeds = HELD_OUT

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start an episode.

        Args:
            seed: Seed of the sampling of courses, starts and looks.
            options: `course`, the seed of a course, and `start`, the seed of a start on it; an
                omitted seed is sampled.

        Raises:
            UnknownName: If the name of an option is unknown.
            WorldError: If a seed is not a whole number of at least 0, or the vehicle touches
                something at the start.
        """
        super().reset(seed=seed)
        options = options or {}
        require_known("option of reset", _OPTIONS, *options)
        world, rng = self.world, self.np_random
        # Seeds are drawn even if options give them, so that later draws stay the same.
        course = self._seeds[int(rng.integers(len(self._seeds)))]
        start = int(rng.integers(2**31))
        look = Look.random(world.course.world, rng) if self._randomise else None
        camera = CameraJitter.random(rng) if self._randomise else None
        course = _seed_of("course", options.get("course", course))
        start = _seed_of("start", options.get("start", start))
        if course != world.seed or look is not None:
            world.lay_out(course, look, camera)
        world.zero_odometer()  # So that no episode depends on earlier ones.
        world.place(start)
        self._begin()
        if world.touches:
            name = world.vehicle.name
            raise WorldError(f"The {name} is stuck at start {start} of course {course}.")
        self._needs_reset = False
        return self._observe()

    def step(self, action: NDArray[np.float32]) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Take one step of one control period.

        Raises:
            SpaceMismatch: If the action is not two finite numbers.
            ResetNeeded: If `reset` was never called.
        """
        if self._needs_reset:
            raise gym.error.ResetNeeded("Call reset() before the first step.")
        values = np.asarray(action, np.float64)
        if values.shape != (2,) or not np.isfinite(values).all():
            raise SpaceMismatch(f"An action is steering and throttle, got {values}.")
        collided, terms, seen, info = self._advance(np.clip(values, -1.0, 1.0))
        info |= terms
        info["reward_terms"] = terms
        return seen, sum(terms.values()), self._reward.ends(collided), False, info

    def _begin(self) -> None:
        """Reset the limits and sensors of the robot."""
        raise NotImplementedError

    def _observe(self) -> tuple[Any, dict[str, Any]]:
        """Return the observation and `info`."""
        raise NotImplementedError

    def _advance(
        self, values: NDArray[np.float64]
    ) -> tuple[bool | None, dict[str, float], Any, dict[str, Any]]:
        """Drive for a period; return collision, terms of the reward, observation and `info`."""
        raise NotImplementedError

    def expert(self) -> ExpertDriver:
        """Return an expert that is given the whole course; its control rate must be the robot's."""
        # Imported here, because experts load SciPy.
        from shapechanger.vehicles.envs.demonstrators import ExpertDriver, require_rate

        require_rate(self.metadata["render_fps"])
        return ExpertDriver(self.world)

    def demonstrator(self, seed: int) -> Demonstrator:
        """Return an expert that recovers from its own mistakes, which `seed` determines."""
        from shapechanger.vehicles.envs.demonstrators import Demonstrator  # SciPy.

        self.expert()  # Checks the control rate.
        return Demonstrator(self.world, lambda: partial(self.expert(), None), seed)

    def render(self) -> NDArray[np.uint8] | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Return the camera's frame, shape (height, width, 3); None without a render mode."""
        if not self.render_mode:
            return None
        if self._needs_reset:
            raise RenderError("Call reset() before render().")
        return self.world.picture()

    @property
    def reach(self) -> float:
        """Distance from the middle of the vehicle to its farthest point, m."""
        return self.world.reach

    def picture(
        self, width: int = 480, height: int = 360, reach: float | None = None
    ) -> NDArray[np.uint8]:
        """Return an image of the vehicle in its world from outside; see `MujocoWorld.outside`."""
        return self.world.outside(width, height, reach)

    def close(self) -> None:
        """Release the renderer, if there is one."""
        self.world.close()

    def _truth(self, progress_m: float) -> dict[str, Any]:
        """Return the entries of `info` that no sensor measures, given the progress, m."""
        world, pose = self.world, self.world.pose
        return {
            "progress": progress_m,
            "collisions": world.collisions,
            "pose": (pose.x, pose.y, pose.heading),
            "course": world.seed,
            "standing": world.inputs().stands,
        }


def space_of(layout: Layout) -> gym.spaces.Box[np.float32]:
    """Return the space of a layout's numbers, `float32`."""
    return gym.spaces.Box(layout.low.astype(np.float32), layout.high.astype(np.float32))
