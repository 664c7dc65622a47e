"""The driving task on a simulated course: what all views of it share."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import EzPickle
from numpy.typing import NDArray

from shapechanger.errors import ProfileError, SpaceMismatch, WorldError
from shapechanger.vehicles.envs.demonstrators import Demonstrator, ExpertDriver, VehicleDemonstrator
from shapechanger.vehicles.envs.setup import CourseSampler, EpisodeSetup
from shapechanger.vehicles.expert.traits import PERIOD_S
from shapechanger.vehicles.world import MujocoWorld


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
