"""The driving task on a simulated course: what all views of it share."""

from __future__ import annotations

import dataclasses
import math
import operator
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal, cast

import gymnasium as gym
import numpy as np
from gymnasium.utils import EzPickle
from numpy.typing import NDArray

from shapechanger.errors import ProfileError, SpaceMismatch, UnknownName, WorldError, check_seed
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.robot.profile.profile import Profile
from shapechanger.vehicles.bodies import require_fit, vehicle_model
from shapechanger.vehicles.cameras.camera import CameraJitter
from shapechanger.vehicles.courses.course import HELD_OUT, TRAINING
from shapechanger.vehicles.courses.look import Look
from shapechanger.vehicles.envs.demonstrators import Demonstrator, ExpertDriver, VehicleDemonstrator
from shapechanger.vehicles.expert.traits import PERIOD_S
from shapechanger.vehicles.world import MujocoWorld

Steering = Literal["proportional", "bang"]
"""Steering angles: any, or only full left, straight and full right, as in 2017."""

_LEVELS: Final[dict[str, Literal["any", "three"]]] = {"proportional": "any", "bang": "three"}
_MAX_PIXELS: Final = 1920  # As in a profile.


def check_frame_size(size: Sequence[int]) -> tuple[int, int]:
    """Return width and height of frames in pixels.

    Raises:
        SpaceMismatch: If it is not two whole numbers in range.
    """
    try:
        wide, high = (operator.index(pixels) for pixels in size)
    except (TypeError, ValueError):
        wide = high = 0
    if not (1 <= wide <= _MAX_PIXELS and 1 <= high <= _MAX_PIXELS):
        raise SpaceMismatch(
            f"The size of a frame is its width and height, each 1 to {_MAX_PIXELS} pixels, "
            f"got {size}."
        )
    return wide, high


def _seed_of(what: str, seed: Any) -> int:
    return check_seed(seed, WorldError, f"The seed of a {what} must be", largest=None)


def resolve_profile(
    vehicle: str,
    robot: str | os.PathLike[str] | None,
    size: Sequence[int] | None = None,
    steering: Steering | None = None,
) -> tuple[Profile, CameraPlan]:
    """Load the profile of a vehicle, and set its steering and its camera's frame size.

    Args:
        vehicle: Name of the vehicle.
        robot: Path or name of the profile; None for `lab-` followed by the vehicle.
        size: Replaces the width and height of its frames, pixels; None to keep them.
        steering: Replaces the profile's steering; None to keep it.

    Returns:
        The profile, and its camera, which simulations show as it is stated there. It is upright,
        because drivers turn the frames of a camera that is mounted upside down.

    Raises:
        UnknownName: If there is no such vehicle, profile or steering.
        ProfileError: If it is not the profile of this vehicle with a camera.
        SpaceMismatch: If the size is out of range.
    """
    vehicle_model(vehicle)  # An unknown vehicle is a better message than a missing profile.
    profile = load_profile(find_profile(f"lab-{vehicle}" if robot is None else robot))
    if profile.camera is None:
        raise ProfileError(f"{profile.path}: the robot has no camera, and this task needs one.")
    actions = profile.actions
    if [action.name for action in actions] != ["steering", "throttle"]:
        names = ", ".join(action.name for action in actions)
        raise ProfileError(
            f"{profile.path}: a vehicle's actions must be steering and throttle, not {names}."
        )
    if steering is not None:
        if steering not in _LEVELS:
            raise UnknownName("steering", steering, _LEVELS)
        actions = (dataclasses.replace(actions[0], levels=_LEVELS[steering]), *actions[1:])
    require_fit(vehicle, {output.part for output in profile.outputs})
    wide, high = profile.camera.size if size is None else check_frame_size(size)
    camera = dataclasses.replace(profile.camera, size=(wide, high), flip=False)
    return dataclasses.replace(profile, actions=actions, camera=camera), camera


Courses = Literal["training", "held-out"] | Sequence[int]
"""Courses for training, held-out courses for evaluation, or courses by their seeds."""

_KINDS: Final = {"training": TRAINING, "held-out": HELD_OUT}
_OPTIONS: Final = ("course", "start")


@dataclass(frozen=True, slots=True)
class EpisodeSetup:
    """Course, start and appearance of one episode.

    Attributes:
        course: Seed of the course.
        start: Seed of the start.
        look: Light and textures; None for the default ones.
        camera: Displacement of the camera; None for none.
    """

    course: int
    start: int
    look: Look | None
    camera: CameraJitter | None


class CourseSampler:
    """Samples course, start and appearance of episodes.

    Args:
        courses: Courses to sample from.
        randomise: Whether to sample light, textures and the camera's pose too.

    Raises:
        UnknownName: If there are no courses of this name.
        WorldError: If there is no course, or a seed is not a whole number from 0.
    """

    def __init__(self, courses: Courses, randomise: bool) -> None:
        if isinstance(courses, str):
            if courses not in _KINDS:
                raise UnknownName("kind of courses", courses, _KINDS)
            self._seeds: Sequence[int] = _KINDS[courses]
        else:
            given: Any = courses  # May be a single seed where nothing checks types.
            seeds = cast("Iterable[Any]", given if isinstance(given, Iterable) else (given,))
            self._seeds = tuple(_seed_of("course", seed) for seed in seeds)
        if not self._seeds:
            raise WorldError("There are no courses to draw from: give at least one seed.")
        self._randomise = randomise

    @property
    def first(self) -> int:
        """Seed of the first course."""
        return self._seeds[0]

    def hold_out(self) -> None:
        """Sample held-out courses from now on."""
        self._seeds = HELD_OUT

    def draw(
        self, rng: np.random.Generator, world: str, options: Mapping[str, Any]
    ) -> EpisodeSetup:
        """Sample the next episode.

        Args:
            rng: Source of randomness. Values that `options` give are drawn all the same, so that
                the others do not depend on the options.
            world: Kind of place.
            options: `course` and `start`, each a seed.

        Raises:
            UnknownName: If there is no such option.
            WorldError: If a seed is not a whole number from 0.
        """
        for name in options:
            if name not in _OPTIONS:
                raise UnknownName("option of reset", name, _OPTIONS)
        course = self._seeds[int(rng.integers(len(self._seeds)))]
        start = int(rng.integers(2**31))
        look = Look.random(world, rng) if self._randomise else None
        camera = CameraJitter.random(rng) if self._randomise else None
        return EpisodeSetup(
            _seed_of("course", options.get("course", course)),
            _seed_of("start", options.get("start", start)),
            look,
            camera,
        )


class DriveEnv(gym.Env[Any, NDArray[np.float32]], EzPickle):
    """The driving task: a vehicle on sampled courses, within its robot's limits.

    Its views are `VehicleEnv` (image and sensors), `RangesEnv` (distances) and `WaypointEnv` (an
    image and an action that all vehicles share).

    Attributes:
        parts: The parts that the robot's outputs move, such as "wheels" and "steering".
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 20}  # noqa: RUF012
    parts: frozenset[str]
    _world: MujocoWorld
    _draw: CourseSampler

    @property
    def world(self) -> MujocoWorld:
        """The simulated world, with its ground truth."""
        return self._world

    def hold_out(self) -> None:
        """Sample held-out courses from the next reset on."""
        self._draw.hold_out()

    def expert(self) -> ExpertDriver:
        """Return the expert that knows the whole course, without mistakes.

        Raises:
            ProfileError: If the robot has another control rate than the expert.
        """
        self._require_rate_of_expert()
        return ExpertDriver(self._world)

    def demonstrator(self, seed: int) -> Demonstrator:
        """Return an expert that knows the whole course and recovers from its own mistakes.

        Args:
            seed: Seed of the mistakes.

        Raises:
            ProfileError: If the robot has another control rate than the expert.
        """
        self._require_rate_of_expert()
        return VehicleDemonstrator(self._world, seed)

    def render(self) -> NDArray[np.uint8] | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Return the camera's picture, shape (height, width, 3); None without a render mode."""
        return self._world.picture() if self.render_mode else None

    @property
    def reach(self) -> float:
        """Distance from the middle of the vehicle to its farthest point, m."""
        return self._world.reach

    def picture(
        self, width: int = 480, height: int = 360, reach: float | None = None
    ) -> NDArray[np.uint8]:
        """Return a picture of the vehicle in its world from outside, shape (height, width, 3).

        Args:
            width: Width in pixels.
            height: Height in pixels.
            reach: Radius in view around the middle of the vehicle, m; None for its own reach.

        Raises:
            RenderError: If the size is out of range, or nothing can be drawn here.
        """
        return self._world.outside(width, height, reach)

    def close(self) -> None:
        """Release the renderer, if there is one."""
        self._world.close()

    def _require_rate_of_expert(self) -> None:
        """Check that the robot takes an action when an expert chooses one.

        Raises:
            ProfileError: If its control rate is another.
        """
        rate = self.metadata["render_fps"]
        if not math.isclose(rate * PERIOD_S, 1.0):
            raise ProfileError(
                f"This robot has control_hz = {rate:g}, and the experts that demonstrate driving "
                f"choose {1.0 / PERIOD_S:g} actions a second: set control_hz = {1.0 / PERIOD_S:g}."
            )

    def _lay_out(self, options: Mapping[str, Any] | None) -> EpisodeSetup:
        """Sample the next episode, and lay out its course."""
        drawn = self._draw.draw(self.np_random, self._world.course.world, options or {})
        if drawn.course != self._world.seed or drawn.look is not None:
            self._world.lay_out(drawn.course, drawn.look, drawn.camera)
        return drawn

    def _require_free(self, drawn: EpisodeSetup) -> None:
        """Check that the vehicle touches nothing at the start.

        Raises:
            WorldError: If it does.
        """
        if self._world.touches:
            raise WorldError(
                f"The {self._world.vehicle.name} is stuck at start {drawn.start} of course "
                f"{drawn.course}: choose another."
            )

    def _values(self, action: Any) -> tuple[float, ...]:
        """Return the values of a command, clipped to -1 to 1.

        Raises:
            SpaceMismatch: If the action is not two finite numbers.
        """
        values = np.clip(np.asarray(action, np.float64), -1.0, 1.0)
        if values.shape != (2,) or not np.isfinite(values).all():
            raise SpaceMismatch(
                f"An action of a vehicle is steering and throttle, got {np.asarray(action)}."
            )
        return tuple(values.tolist())

    def _truth(self, progress_m: float) -> dict[str, Any]:
        """Return the entries of `info` that no sensor measures, given the progress, m."""
        world, pose = self._world, self._world.pose
        return {
            "progress": progress_m,
            "collisions": world.collisions,
            "pose": (pose.x, pose.y, pose.heading),
            "course": world.seed,
            "standing": world.inputs().stands,
        }
