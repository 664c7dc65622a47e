"""The driving task on distances instead of images, without emulating the robot."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.contract.limits import Bump, Propulsion, aimed, slewed
from shapechanger.contract.plan import GuardPlan, output_values
from shapechanger.contract.world import STANDING_MPS
from shapechanger.layout import Feature, Layout
from shapechanger.vehicles.envs.drive import Courses, DriveEnv, simulated_robot, space_of
from shapechanger.vehicles.waypoints import LEAST_THROTTLE
from shapechanger.vehicles.world import MujocoWorld

BEARINGS_DEG: Final = (-90, -60, -35, -15, 0, 15, 35, 60, 90)
"""Bearings of the distances that a teacher sees, degrees from the heading, positive to the left."""

FARTHEST_M: Final = 6.0
"""Distance that a ray measures without an obstacle, m."""

_BEARINGS: Final = np.radians(BEARINGS_DEG)

COLLISION_REWARD: Final = -3.0
"""Reward of a collision: it costs three metres."""

# Distance below which the reward falls, m, and the largest cost, 1/s. Without the cost, teachers
# squeezed through gaps that a camera with 31 degrees to each side does not show. With the cost,
# teachers brake and drive back, and a student learns this too.
_NEAR_M, _NEAR_COST = 0.35, 3.0
_LAYOUT: Final = Layout(
    (
        *(Feature(f"range/{bearing:+d}deg", "m", 0.0, FARTHEST_M) for bearing in BEARINGS_DEG),
        Feature("speed", "m/s", -5.0, 5.0),
        Feature("yaw_rate", "rad/s", -15.0, 15.0),
    )
)
_COURSES: Final = range(48)  # Courses for training, few enough to keep their compiled models.


class MeanOutputs:
    """Mean outputs over control periods, from rest; sensors and rounding are left out.

    Stalls and deadlines are not simulated; a simulated command never misses a deadline.
    """

    def __init__(self, plan: GuardPlan) -> None:
        self._plan = plan
        self._tick_s = 1.0 / plan.tick_hz
        self._tick_ns = round(1e9 / plan.tick_hz)
        self._forward = Propulsion(plan.actions).forward
        self._now_ns = 0
        self._bump = Bump(plan.limits.bump_hold_ms)
        self._applied = tuple(action.rest for action in plan.actions)

    def outputs(
        self, values: tuple[float, ...], bumped: bool, ticks: int
    ) -> Mapping[str, float | None]:
        """Return the mean output of each part over a control period."""
        self._bump.sense({"bump": float(bumped)}, self._now_ns)
        actions = self._plan.actions
        aims = [aimed(action, value) for action, value in zip(actions, values, strict=True)]
        if self._bump.blocks(self._now_ns):
            for i in self._forward:
                aims[i] = min(aims[i], actions[i].rest)
        self._now_ns += ticks * self._tick_ns
        target = tuple(aims)
        total = [0.0] * len(self._plan.outputs)
        left = ticks
        while left:
            # After an output has reached its target, it is constant for the rest of the period.
            repeats = left if self._applied == target else 1
            left -= repeats
            values_now = output_values(self._plan, self._applied)
            total = [one + repeats * now for one, now in zip(total, values_now, strict=True)]
            if repeats == 1:
                self._applied = tuple(
                    slewed(action, now, aim, self._tick_s)
                    for action, now, aim in zip(actions, self._applied, target, strict=True)
                )
        outputs = self._plan.outputs
        return {out.part: one / ticks for out, one in zip(outputs, total, strict=True)}


def observe_ranges(world: MujocoWorld) -> NDArray[np.float32]:
    """Return the observation of a teacher, shape (11,).

    Distances from the middle of the front bumper at `BEARINGS_DEG`, m, up to `FARTHEST_M`; speed
    along the heading, m/s; rate of turn, rad/s, counter-clockwise.
    """
    seen = world.inputs()
    distances = world.ranges_m(_BEARINGS, FARTHEST_M)
    return np.array((*distances, seen.speed, seen.yaw_rate), np.float32)


def leave_rest(action: NDArray[Any], stands: bool) -> NDArray[Any]:
    """Return steering and throttle, (2,), that move a standing vehicle unless the throttle is 0.

    A teacher drives with its mean action. A mean throttle near 0 does not overcome static friction,
    so the vehicle would never move again; in training, exploration moved it.
    """
    steering, throttle = action
    if not stands or throttle == 0.0 or abs(throttle) >= LEAST_THROTTLE:
        return action
    return np.array((steering, np.copysign(LEAST_THROTTLE, throttle)), action.dtype)


class RangesEnv(DriveEnv):
    """Drive fast without collisions, seeing distances all around the front.

    Task, vehicle and courses are the same as in `shapechanger/Car-v1`, but observations are the
    true state of the world. A teacher is trained here, and a student with a camera learns from the
    teacher (`shapechanger train Car --teacher ...`). Only the arithmetic of the robot's guard is
    simulated: a step of the task with other sensors but no image takes 2.4 times as long for the
    car and the boat, 2.3 times for the truck and 1.7 times for the tank.

    ## Action space
    `Box(-1, 1, (2,), float32)`; -1 steers left, +1 drives forward. An action lasts one control
    period of the profile, 1/20 s. If the vehicle stands still, the size of a throttle other than 0
    is raised to at least 0.25, which moves the vehicle.

    | Num | Action     | Min | Max | Unit |
    | --- | ---------- | --- | --- | ---- |
    | 0   | `steering` | -1  | 1   | 1    |
    | 1   | `throttle` | -1  | 1   | 1    |

    ## Observation space
    `Box((11,), float32)`: distances from the middle of the front bumper to walls and obstacles, by
    their bearings, positive to the left; speed along the heading; and rate of turn,
    counter-clockwise.

    | Num | Observation    | Min | Max | Unit  |
    | --- | -------------- | --- | --- | ----- |
    | 0   | `range/-90deg` | 0   | 6   | m     |
    | 1   | `range/-60deg` | 0   | 6   | m     |
    | 2   | `range/-35deg` | 0   | 6   | m     |
    | 3   | `range/-15deg` | 0   | 6   | m     |
    | 4   | `range/+0deg`  | 0   | 6   | m     |
    | 5   | `range/+15deg` | 0   | 6   | m     |
    | 6   | `range/+35deg` | 0   | 6   | m     |
    | 7   | `range/+60deg` | 0   | 6   | m     |
    | 8   | `range/+90deg` | 0   | 6   | m     |
    | 9   | `speed`        | -5  | 5   | m/s   |
    | 10  | `yaw_rate`     | -15 | 15  | rad/s |

    ## Reward
    The sum of four terms, for the progress along the course p, m, the least distance in the
    observation c, m, and dt = 0.05 s; `reward` replaces the weights 1, -3 and -1 of `DriveReward`:

    ```text
    reward_velocity  =  1 p
    reward_collision = -3 if there is a new collision
    reward_stall     = -1 dt if abs(p) / dt < 0.1 m/s
    reward_near      = -3 dt max(0, 1 - c / 0.35 m)
    ```

    ## End
    Terminated by a collision, unless `put_back`. Truncated after 400 steps.

    ## Versions
    v1: the first.

    Args:
        vehicle: As in `VehicleEnv`, with its errors.
        robot: As in `VehicleEnv`.
        reward: Weights that replace the default ones, keyed by name; see `DriveReward`.
        courses: "training" or "held-out", or the seeds of the courses to sample from; the default
            is 48 training courses, which are laid out once.
        camera: Whether `world.picture()` shows the images of the profile's camera.
        **task: `world`, `randomise`, `put_back`, `lenses` and `render_mode` of `VehicleEnv`. After
            a collision with `put_back`, the bumper's reflex keeps the vehicle from going forward
            for 0.75 s.
    """

    def __init__(
        self,
        vehicle: str,
        *,
        robot: str | os.PathLike[str] | None = None,
        reward: Mapping[str, float] | None = None,
        courses: Courses = _COURSES,
        camera: bool = False,
        **task: Any,
    ) -> None:
        profile = simulated_robot(vehicle, robot)
        weights = {"collision": COLLISION_REWARD, **(reward or {})}
        super().__init__(
            profile, vehicle, weights, has_camera=camera, coarse=True, courses=courses, **task
        )
        self._plan = profile.plan
        self._ticks = round(self._plan.tick_hz / profile.control_hz)
        self._period_s = 1.0 / profile.control_hz
        self.observation_layout = _LAYOUT
        self.observation_space = space = space_of(_LAYOUT)
        self._low, self._high = space.low, space.high

    def _begin(self) -> None:
        self._shaper = MeanOutputs(self._plan)
        self._bumped = False
        self._progress_m = 0.0

    def _advance(
        self, values: NDArray[np.float64]
    ) -> tuple[bool, dict[str, float], NDArray[np.float32], dict[str, Any]]:
        world, shaper = self.world, self._shaper
        progress, collisions = self._progress_m, world.collisions
        command = tuple(leave_rest(values, world.inputs().stands).tolist())
        world.advance(self._period_s, shaper.outputs(command, self._bumped, self._ticks))
        collided = world.collisions > collisions
        self._bumped = world.bumped  # Before `put_back`: the reflex lasts longer than the contact.
        self._progress_m = world.progress_m
        speed = (self._progress_m - progress) / self._period_s
        stands = abs(speed) < STANDING_MPS
        # Without a cost of standing, two of four teachers learned to stop in front of a wall.
        terms = self._reward.terms(speed, collided, stands, self._period_s)
        if collided and self._puts_back:
            world.put_back()
            self._progress_m = world.progress_m
        seen, info = self._observe()
        nearest = float(seen[: len(BEARINGS_DEG)].min())
        terms["reward_near"] = -_NEAR_COST * self._period_s * max(0.0, 1.0 - nearest / _NEAR_M)
        return collided, terms, seen, info

    def _observe(self) -> tuple[NDArray[np.float32], dict[str, Any]]:
        seen = observe_ranges(self.world)
        seen = np.minimum(np.maximum(seen, self._low, out=seen), self._high, out=seen)
        return seen, self._truth(self._progress_m)
