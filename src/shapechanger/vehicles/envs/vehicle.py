"""Gymnasium envs of a car, tank, boat and truck with a camera, driven by steering or waypoints."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Final

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import ProfileError
from shapechanger.layout import Element, Feature, Layout
from shapechanger.vehicles.bodies import vehicle_model
from shapechanger.vehicles.courses.course import FLOODED
from shapechanger.vehicles.envs.drive import Courses, DriveEnv, Steering, simulated_robot, space_of
from shapechanger.vehicles.envs.ranges import RangesEnv, leave_rest, observe_ranges
from shapechanger.vehicles.envs.sensed import SensedVehicle
from shapechanger.vehicles.envs.shift import certify_vehicles
from shapechanger.vehicles.waypoints import SteeringResponse, WaypointView, measure_response

if TYPE_CHECKING:
    from shapechanger.vehicles.envs.demonstrators import Demonstrator

_REWARDED: Final = ("speed", "stall", "collision")  # Quantities on which the reward depends.


class VehicleEnv(DriveEnv):
    """Drive fast without collisions, with a camera that looks ahead.

    A profile defines the robot. Its caps, slew, reflexes and sensors act as on hardware, by the
    functions of the guard. Pins, chips and the link are not simulated here, but a robot's twin
    emulates them, and reaches the same positions. `shapechanger/RemoteVehicle-v1` is the same task
    on hardware or on a twin.

    ## Observation space
    The camera's frame, RGB, `uint8`, shape (height, width, 3), (120, 160, 3) by default; with
    `state=True` a Dict of `image` and `state`; with `image=False` the state alone.
    `observation_layout` describes them. The state is `float32`; a number without a sensor has the
    middle of its range. For the profiles `lab-car`, `lab-tank`, `lab-boat` and `lab-truck`:

    | Num | Observation        | Min  | Max | Unit  |
    | --- | ------------------ | ---- | --- | ----- |
    | 0   | `speed`            | -inf | inf | m/s   |
    | 1   | `distance`         | 0    | inf | m     |
    | 2   | `bump`             | 0    | 1   | 1     |
    | 3   | `stall`            | 0    | 1   | 1     |
    | 4   | `collision`        | 0    | 1   | 1     |
    | 5   | `yaw_rate`         | -inf | inf | rad/s |
    | 6   | `acceleration_x`   | -inf | inf | m/s²  |
    | 7   | `acceleration_y`   | -inf | inf | m/s²  |
    | 8   | `battery`          | 0    | inf | V     |
    | 9   | `steering/applied` | -1   | 1   | 1     |
    | 10  | `throttle/applied` | -1   | 1   | 1     |

    ## Reward
    The sum of the terms of `DriveReward`, for the speed v along the heading, m/s, and dt = 0.05 s;
    `reward` replaces the weights 1, -10 and -1. The robot's own sensors measure all of them;
    `info["reward_sources"]` names the sensors.

    ```text
    reward_velocity  =   1 dt v
    reward_collision = -10 if there is a new collision
    reward_stall     =  -1 dt while the vehicle pushes without moving
    ```

    ## End
    Terminated by a collision, which the bumper or a stall reveals, unless `put_back` is set or
    `collision_ends_episode` is 0. Truncated after 1,000 steps.

    ## Info
    `progress`, metres along the course since the start; `collisions` of any part of the vehicle
    since the start, even if no bumper detects them; `pose`, (x, y, heading) in m and rad; `course`,
    the seed of the course; `standing`, whether the vehicle neither moves nor turns. Keys shared
    with `RemoteVehicleEnv`: `action_applied`, `stop_reason`, `refused`, `armed`, `emergency`,
    `absent`, `reward_terms` and its terms, `reward_sources`, `captured_ns`, `decided_ns`.

    ## Versions
    v1: the first.

    Args:
        vehicle: "car", "tank", "boat" or "truck".
        world: "corridor", "yard", "harbour" or "flooded-corridor"; None for the vehicle's
            usual place.
        robot: Path or name of a profile; None for `lab-` followed by the vehicle.
        steering: Steering that replaces the profile's; None for the profile's steering.
        size: Width and height of frames in pixels; None for the profile's size.
        image: Whether observations include the frame.
        state: Whether observations include the state next to the frame.
        reward: Weights that replace the profile's, keyed by name.
        courses: Courses that `reset` samples: "training", "held-out" or seeds.
        randomise: Whether `reset` also samples light, textures and the camera's pose.
        put_back: Whether to put the vehicle back on the lane after a collision, as a person next to
            it would. A collision then does not end the episode.
        lenses: Impairments of the camera, such as ("night", "dirt"); see
            `shapechanger.vehicles.cameras.camera`.
        render_mode: "rgb_array" for `render` to return the newest frame.

    Attributes:
        parts: The parts that the robot's outputs move, such as "wheels" and "steering".

    Raises:
        UnknownName: If the name of a vehicle, world, profile, steering, weight, lens, render mode
            or kind of courses is unknown.
        ProfileError: If the profile does not fit the vehicle's parts, or has no camera.
        SpaceMismatch: If the frame size is out of range.
        WorldError: If the vehicle cannot drive in the world.
    """

    record_clock: Final = "twin"
    """Clock of the nanoseconds in `info`."""
    certify_shift = staticmethod(certify_vehicles)

    def __init__(
        self,
        vehicle: str,
        *,
        world: str | None = None,
        robot: str | os.PathLike[str] | None = None,
        steering: Steering | None = None,
        size: Sequence[int] | None = None,
        image: bool = True,
        state: bool = False,
        reward: Mapping[str, float] | None = None,
        courses: Courses = "training",
        randomise: bool = False,
        put_back: bool = False,
        lenses: Sequence[str] = (),
        render_mode: str | None = None,
    ) -> None:
        self.welcome = profile = simulated_robot(vehicle, robot, size, steering)
        weights = {**profile.reward, **(reward or {})}
        super().__init__(
            profile, vehicle, weights, has_camera=image, world=world, courses=courses,
            randomise=randomise, put_back=put_back, lenses=lenses, render_mode=render_mode,
        )  # fmt: skip
        self._period_ns = round(1e9 / profile.control_hz)
        self._has_image, self._has_state = image, state or not image
        self._state = profile.state_layout
        self._absent = {feature.name: feature.middle for feature in self._state}
        self._applied = [f"{action.name}/applied" for action in profile.plan.actions]
        shape = (*profile.size[::-1], 3)
        pixels = Feature("camera/image", "1", 0.0, 255, Element("camera", "camera"), shape)
        self.observation_layout = Layout(
            ((pixels,) if image else ()) + (self._state.features if self._has_state else ())
        )
        spaces: dict[str, gym.Space[Any]] = {
            "image": gym.spaces.Box(0, 255, shape, np.uint8), "state": space_of(self._state)
        }  # fmt: skip
        self.observation_space: gym.Space[Any] = spaces["image" if image else "state"]
        if image and state:
            self.observation_space = gym.spaces.Dict(spaces)

    def _begin(self) -> None:
        self._vehicle = SensedVehicle(self.welcome.plan, self.world)
        # As on a robot, the first observation comes after one period.
        self._vehicle.advance(self._period_ns, None)
        self._touched = bool(self._vehicle.quantities.get("collision"))

    def _advance(
        self, values: NDArray[np.float64]
    ) -> tuple[bool | None, dict[str, float], Any, dict[str, Any]]:
        vehicle, world = self._vehicle, self.world
        collisions, bumps = world.collisions, vehicle.bumps
        vehicle.advance(self._period_ns, values.tolist())
        speed, touches, stall = map(vehicle.quantities.get, ("speed", "collision", "stall"))
        hits = bool(touches) or vehicle.bumps > bumps
        collided = None if touches is None else hits and not self._touched
        self._touched = hits
        stalled = None if stall is None else bool(stall)
        terms = self._reward.terms(speed, collided, stalled, self._period_ns / 1e9)
        seen, info = self._observe()
        # The vehicle is put back after the observation, which shows the collision.
        if self._puts_back and world.collisions > collisions:
            world.put_back()
        return collided, terms, seen, info

    @property
    def teacher_env(self) -> str:
        """Id of the env in which a teacher for this vehicle learns; see `RangesEnv`."""
        return f"shapechanger/{self.world.vehicle.name.capitalize()}Ranges-v1"

    def taught_by(self, act: Callable[[NDArray[Any]], NDArray[Any]], seed: int) -> Demonstrator:
        """Return a teacher as the demonstrator of this env.

        Args:
            act: Policy of `teacher_env`: maps observations, (n, 11), to actions, (n, 2).
            seed: Seed of the demonstrator's random disturbances.

        Raises:
            ProfileError: If the control rates of the robot and of the teacher differ.
        """
        from shapechanger.vehicles.envs.demonstrators import Demonstrator, require_rate  # SciPy.

        require_rate(self.metadata["render_fps"])

        def teach() -> NDArray[np.float32]:
            action = act(observe_ranges(self.world)[np.newaxis])[0].astype(np.float32)
            return leave_rest(action, self.world.inputs().stands)

        return Demonstrator(self.world, lambda: teach, seed)

    def _observe(self) -> tuple[Any, dict[str, Any]]:
        vehicle, world = self._vehicle, self.world
        numbers = vehicle.quantities | dict(zip(self._applied, vehicle.applied, strict=True))
        values = map(numbers.get, self._absent, self._absent.values())
        state = np.array([*values], np.float32)
        seen: Any = state
        if self._has_image:
            image = world.picture()
            seen = {"image": image, "state": state} if self._has_state else image
        return seen, self._truth(world.progress_m) | {
            "action_applied": np.array(vehicle.applied, np.float32),
            "stop_reason": vehicle.reason,
            "refused": "",
            "armed": True,
            "emergency": False,
            "absent": tuple([name for name in self._absent if name not in numbers]),
            "reward_sources": {name: vehicle.sources.get(name, "absent") for name in _REWARDED},
            "captured_ns": vehicle.now_ns,
            "decided_ns": vehicle.now_ns - self._period_ns,
        }


@lru_cache(maxsize=32)
def _response_of(
    vehicle: str,
    world: str,
    robot: str | os.PathLike[str] | None,
    sensed: bool,
    motion_at: tuple[int, int],
) -> SteeringResponse:
    """Measure the response of a simulated vehicle, once in a process."""
    common: dict[str, Any] = {"world": world, "robot": robot, "courses": (0,), "put_back": True}
    env = VehicleEnv(vehicle, image=False, **common) if sensed else RangesEnv(vehicle, **common)
    with closing(env):
        return measure_response(env, *motion_at)


class WaypointEnv(WaypointView, DriveEnv):
    """The driving task with a camera and an action that are the same for all vehicles.

    Steering to the full left gives a different circle for each vehicle, but a waypoint means the
    same for all vehicles. A policy that was trained on one vehicle can therefore drive another.
    Images are warped to one virtual camera (`shapechanger.vehicles.cameras.rectify`). Each vehicle
    converts waypoints to steering by its `SteeringResponse`, measured when the env is made.

    ## Reward
    The sum of the terms of `RangesEnv`: metres of progress along the course, -3 for each collision,
    -1 dt while it stands, and `reward_near` = -3 dt max(0, 1 - clearance / 0.35 m), dt = 0.05 s.
    With `sensed`, that of `VehicleEnv`: metres forward, -10 for each collision and -1 dt while it
    pushes without moving, as its sensors measure them. `reward` replaces the weights.

    ## End
    Terminated by a collision, unless `put_back`. Truncated after 1,000 steps.

    ## Versions
    v1: the first.

    Args:
        vehicle: As in `VehicleEnv`, with its errors.
        robot: As in `VehicleEnv`.
        world: "corridor", "yard", "harbour" or "flooded-corridor"; None for the corridor, flooded
            for a boat, so that only the bodies of vehicles differ.
        sensed: Whether the robot is simulated as in `VehicleEnv`, its sensors measure speed and
            reward, and `info` has all keys of `VehicleEnv`; otherwise speed and reward are the true
            ones; see `RangesEnv`.
        **task: `reward`, `courses`, `randomise`, `put_back`, `lenses` and `render_mode` of
            `VehicleEnv`. Warping ignores errors of the camera's pose, so with `randomise` images
            show them.

    Attributes:
        parts: The parts that the robot's outputs move.
        response: How the vehicle turns.

    Raises:
        ProfileError: If the robot has no camera that covers the virtual camera's view.
    """

    certify_shift = staticmethod(certify_vehicles)

    def __init__(
        self,
        vehicle: str,
        *,
        world: str | None = None,
        robot: str | os.PathLike[str] | None = None,
        sensed: bool = False,
        **task: Any,
    ) -> None:
        body, profile = vehicle_model(vehicle), simulated_robot(vehicle, robot)
        world = world or (FLOODED if body.floats else "corridor")
        task = {"courses": "training", **task, "world": world, "robot": robot}
        inner = {"state": True} if sensed else {"camera": True}
        env: DriveEnv = (VehicleEnv if sensed else RangesEnv)(vehicle, **inner, **task)
        self.parts, self.world = env.parts, env.world
        self._see(
            env, profile.path, (*profile.camera_deg, profile.size),
            ("speed", "yaw_rate"), ProfileError, turns_on_the_spot=body.turning_radius_m == 0.0,
        )  # fmt: skip
        self.response = _response_of(vehicle, world, robot, sensed, self._motion_at)

    def hold_out(self) -> None:
        """Sample held-out courses from the next reset on."""
        self._env.hold_out()

    def demonstrator(self, seed: int) -> Demonstrator:
        """Return an expert that recovers from its own mistakes; see `DriveEnv.demonstrator`."""
        from shapechanger.vehicles.envs import demonstrators  # SciPy.

        demonstrators.require_rate(self.metadata["render_fps"])
        return demonstrators.waypoint_demonstrator(self.world, seed)
