"""Drivers of vehicles: experts, demonstrators, and the shipped camera policies."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import ProfileError, WorldError, check_seed
from shapechanger.vehicles.courses.course import Course
from shapechanger.vehicles.expert import PERIOD_S
from shapechanger.vehicles.expert.driver import CourseExpert, traits_of
from shapechanger.vehicles.waypoints import AHEAD_M, WIDEST_RAD
from shapechanger.vehicles.world import MujocoWorld

_FOLDER: Final = Path(__file__).parent / "clones"

CLONES: Final[Mapping[str, Path]] = MappingProxyType(
    {vehicle: _FOLDER / f"{vehicle}.safetensors" for vehicle in ("boat", "car", "tank", "truck")}
)
"""Files of the shipped camera policies by vehicle; `shapechanger.load_policy` reads them.

Each was cloned from ten minutes of its expert's driving; `clones/README.md` is their model card.
"""

Driver = Callable[[], NDArray[np.float32]]
"""A driver: a function that returns the next action, (2,)."""

_WANDER_S: Final = 0.6  # Correlation time of the wandering.
_JERKS_PER_S, _JERK_S = 0.25, (0.15, 0.5)  # Mean rate of jerks, and range of their duration.
_THROTTLE_SD: Final = 0.1  # Standard deviation of the wandering of the throttle.


class Demonstrator:
    """Driver that makes mistakes and recovers from them, so that demonstrations show corrections.

    The vehicle executes the disturbed action, and the driver's own action is recorded (M. Laskey et
    al., "DART: Noise Injection for Robust Imitation Learning", CoRL 2017). There are two kinds of
    noise: slow wandering (G. E. Uhlenbeck, L. S. Ornstein, "On the theory of the Brownian motion",
    Physical Review 36, 1930) and rare jerks of the steering. `begin` is called at the beginning of
    an episode, and returns the driver. `sway` is the standard deviation of the wandering of the
    steering; jerks are up to three times as large. By default it is in the vehicle's `Traits`.
    """

    def __init__(
        self,
        world: MujocoWorld,
        begin: Callable[[], Driver],
        seed: int,
        sway: float | None = None,
    ) -> None:
        self._begin = begin
        sway = traits_of(world.vehicle.name).sway if sway is None else sway
        self._size = np.array((sway, _THROTTLE_SD))
        kind = "The seed of a driver must be"
        self._seeds = np.random.default_rng(check_seed(seed, WorldError, kind, largest=None))
        self.begin()

    def begin(self) -> None:
        """Begin an episode."""
        self._rng = np.random.default_rng(int(self._seeds.integers(2**31)))
        self._wander = np.zeros(2)
        self._jerk, self._jerk_s = 0.0, 0.0
        self._action = self._begin()

    def act(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the driver's action, to be learned, and the disturbed action to execute, (2,)."""
        action = self._action()
        # The exact discretization, for any period.
        keep = math.exp(-PERIOD_S / _WANDER_S)
        fresh = self._size * math.sqrt(1 - keep**2)
        self._wander = keep * self._wander + fresh * self._rng.standard_normal(2)
        noise = self._wander + np.array((self._jerked(), 0.0))
        return action, np.clip(action + noise, -1.0, 1.0).astype(np.float32)

    def _jerked(self) -> float:
        """Steering of the current jerk; 0 without a jerk."""
        self._jerk_s -= PERIOD_S
        if self._jerk_s <= 0:
            if self._rng.random() >= _JERKS_PER_S * PERIOD_S:
                return 0.0
            self._jerk = float(3 * self._size[0] * self._rng.uniform(-1, 1))
            self._jerk_s = float(self._rng.uniform(*_JERK_S))
        return self._jerk


def require_rate(control_hz: float) -> None:
    """Raise a ProfileError unless a robot has the control rate of the experts."""
    if not math.isclose(control_hz * PERIOD_S, 1.0):
        raise ProfileError(
            f"This robot has control_hz = {control_hz:g}, and the experts that demonstrate driving "
            f"choose {1.0 / PERIOD_S:g} actions a second: set control_hz = {1.0 / PERIOD_S:g}."
        )


class ExpertDriver:
    """Expert that drives on the present course of a world, in periods of 1/20 s."""

    def __init__(self, world: MujocoWorld) -> None:
        self._world = world
        self._course: Course | None = None
        self._placed = 0

    def __call__(self, observation: Any) -> NDArray[np.float32]:
        """Return an action, (2,), steering and throttle; the observation is ignored."""
        world, seen = self._world, self._world.inputs()
        if world.course is not self._course:
            self._course = world.course
            self._expert = CourseExpert(world.course, world.vehicle.name, path=world.path())
        if world.placed != self._placed:
            self._placed = world.placed
            self._expert.reset(seen.pose)
        return self._expert.act(seen.pose, seen.speed, seen.yaw_rate)


# Standard deviation of the bearing's disturbance: the effect of steering by 0.25 in the car.
_BEARING_SWAY: Final = 0.18


def waypoint_demonstrator(world: MujocoWorld, seed: int) -> Demonstrator:
    """Return an expert with waypoints as actions: the bearing of the path ahead, and the speed."""

    def begin() -> Driver:
        expert = CourseExpert(world.course, world.vehicle.name, path=world.path())
        path = expert.path

        def point() -> NDArray[np.float32]:
            pose = world.pose
            station = path.nearest(pose.x, pose.y).station
            x, y = path.at(station + AHEAD_M)
            left = math.remainder(math.atan2(y - pose.y, x - pose.x) - pose.heading, math.tau)
            share = expert.speeds[path.index(station)] / world.vehicle.top_speed_mps
            return np.clip((-left / WIDEST_RAD, 2.0 * share - 1.0), -1.0, 1.0).astype(np.float32)

        return point

    return Demonstrator(world, begin, seed, _BEARING_SWAY)
