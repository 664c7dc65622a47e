"""Car, tank, boat and truck as Gymnasium envs that see a camera's image and a robot's sensors."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import gymnasium as gym
import numpy as np
from gymnasium.utils import EzPickle
from numpy.typing import NDArray

from shapechanger.layout import Element, Feature, Layout
from shapechanger.vehicles.envs.drive import (
    Courses,
    DriveEnv,
    Steering,
    simulated_robot,
    space_of,
)
from shapechanger.vehicles.envs.ranges import leave_rest, observe_ranges
from shapechanger.vehicles.envs.sensed import SensedVehicle
from shapechanger.vehicles.envs.shift import certify_vehicles

if TYPE_CHECKING:
    from shapechanger.vehicles.envs.demonstrators import Demonstrator

_ABSENT: Final = "absent"


class VehicleEnv(DriveEnv):
    """Drive fast without collisions, with a camera that looks ahead.

    The robot is defined by a profile: its caps, slew, reflexes and sensors act as on the bench, by
    the guard's own functions. Pins, chips and the link are left out; a robot's twin emulates them,
    and drives to the same place. `shapechanger/RemoteVehicle-v1` is the same task on hardware, on a
    twin, or over the link.

    ## Action space
    `Box(-1, 1, (2,), float32)`: `[steering, throttle]`; -1 steers left, +1 drives forward. It acts
    for one control period of the profile, 1/20 s.

    ## Observation space
    The camera's frame, RGB, `uint8`, shape (height, width, 3), (120, 160, 3) by default; with
    `state=True` a Dict of `image` and `state`; with `image=False` the state alone.
    `observation_layout` names the numbers of the state.

    ## Reward
    `DriveReward`: metres forward, minus collisions and seconds of being stuck, all measured by the
    robot's own sensors. `info["reward_terms"]` and `info["reward_sources"]` give its terms and
    where they come from.

    ## Start
    At a random place of a course that the seed draws, looking along it, at rest.

    ## End
    Terminated when the bumper touches something, unless `collision_ends_episode` is 0. Truncated
    after 1,000 steps.

    ## Info
    `progress`, metres along the course since the start; `collisions` since the start, of any part
    of the vehicle, also where no bumper detects them; `pose`, (x, y, heading) in m and rad;
    `course`, the seed of the course; `standing`, whether it neither moves nor turns; and as
    `RemoteVehicleEnv`: `action_applied`, `stop_reason`, `refused`, `armed`, `emergency`, `absent`,
    `reward_terms`, `reward_sources`, `captured_ns`, `decided_ns`.

    Args:
        vehicle: "car", "tank", "boat" or "truck".
        world: "corridor", "yard", "harbour" or "flooded-corridor"; None for the vehicle's
            usual place.
        robot: Path or name of a profile; None for `lab-` followed by the vehicle.
        steering: Replaces the profile's steering; None to keep it.
        size: Width and height of frames in pixels; None for the profile's.
        image: Whether observations include the frame.
        state: Whether observations include the state besides the frame.
        reward: Weights by name that replace those of the profile.
        courses: "training" or "held-out" for the courses that `reset` samples, or their seeds.
        randomise: Whether `reset` samples light, textures and the camera's pose too.
        put_back: Whether to put the vehicle back on the lane after a collision, as a person beside
            it would do. A collision then does not end the episode.
        lenses: Impairments of the camera, such as ("night", "dirt"); see
            `shapechanger.vehicles.cameras.corruptions`.
        render_mode: "rgb_array" for `render` to return the newest frame.

    Attributes:
        parts: The parts that the robot's outputs move, such as "wheels" and "steering".

    Raises:
        UnknownName: If there is no such vehicle, world, profile, steering, weight, lens, render
            mode or kind of courses.
        ProfileError: If the profile moves other parts than the vehicle has, or has no camera.
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
        arguments = {n: v for n, v in locals().items() if n not in ("self", "__class__", "vehicle")}
        EzPickle.__init__(self, vehicle, **arguments)
        self.welcome = profile = simulated_robot(vehicle, robot, size, steering)
        self._set_up(
            profile, vehicle, world, courses, {**profile.reward, **(reward or {})},
            randomise=randomise, put_back=put_back, has_camera=image, render_mode=render_mode,
            lenses=(lenses,) if isinstance(lenses, str) else tuple(lenses),
        )  # fmt: skip
        self._vehicle = SensedVehicle(profile.plan, self._world)
        self._period_ns = round(1e9 / profile.control_hz)
        self._has_image, self._has_state = image, state or not image
        self._state = profile.state_layout
        self._applied_at = {
            f"{action.name}/applied": i for i, action in enumerate(profile.plan.actions)
        }
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
        self._vehicle.start()
        # A robot sends its first observation after one period, too.
        self._vehicle.advance(self._period_ns, None)
        self._touched = bool(self._touches())

    def _advance(
        self, values: NDArray[np.float64]
    ) -> tuple[bool | None, dict[str, float], Any, dict[str, Any]]:
        vehicle, world = self._vehicle, self._world
        collisions, bumps = world.collisions, vehicle.bumps
        vehicle.advance(self._period_ns, values.tolist())
        touches = self._touches()
        hits = bool(touches) or vehicle.bumps > bumps
        collided = None if touches is None else hits and not self._touched
        self._touched = hits
        speed, stall = (vehicle.quantities.get(name) for name in ("speed", "stall"))
        stalled = None if stall is None else bool(stall)
        terms = self._reward.terms(speed, collided, stalled, self._period_ns / 1e9)
        seen, info = self._observe()
        # After the observation, as a person would do who has seen the collision.
        if self._puts_back and world.collisions > collisions:
            world.put_back()
        return collided, terms, seen, info

    @property
    def teacher_env(self) -> str:
        """Id of the env in which a teacher for this vehicle learns; see `RangesEnv`."""
        return f"shapechanger/{self._world.vehicle.name.capitalize()}Ranges-v1"

    def taught_by(self, act: Callable[[NDArray[Any]], NDArray[Any]], seed: int) -> Demonstrator:
        """Return a teacher as the demonstrator of this env.

        Args:
            act: Policy of `teacher_env`: maps observations, (n, 11), to actions, (n, 2).
            seed: Seed of its mistakes.

        Raises:
            ProfileError: If the robot has another control rate than the teacher.
        """
        from shapechanger.vehicles.envs.demonstrators import Demonstrator, require_rate

        require_rate(self.metadata["render_fps"])

        def teach() -> NDArray[np.float32]:
            action = act(observe_ranges(self._world)[np.newaxis])[0].astype(np.float32)
            return leave_rest(action, self._world.inputs().stands)

        return Demonstrator(self._world, lambda: teach, seed)

    def _touches(self) -> float | None:
        """Return whether sensors say that it touches something, 0 or 1; None if none can say."""
        quantities = self._vehicle.quantities
        return quantities.get("collision", quantities.get("bump"))

    def _observe(self) -> tuple[Any, dict[str, Any]]:
        vehicle, world = self._vehicle, self._world
        state, absent = np.empty(self._state.size, np.float32), list[str]()
        for i, feature in enumerate(self._state.features):
            place = self._applied_at.get(feature.name)
            value = (
                vehicle.quantities.get(feature.name) if place is None else vehicle.applied[place]
            )
            if value is None:
                absent.append(feature.name)
            state[i] = feature.middle if value is None else value
        seen: Any = state
        if self._has_image:
            image = world.picture()
            seen = {"image": image, "state": state} if self._has_state else image
        sources = {name: vehicle.sources.get(name, _ABSENT) for name in ("speed", "stall")}
        touch = vehicle.sources.get("collision", vehicle.sources.get("bump", _ABSENT))
        return seen, self._truth(world.progress_m) | {
            "action_applied": np.array(vehicle.applied, np.float32),
            "stop_reason": vehicle.reason,
            "refused": "",
            "armed": True,
            "emergency": False,
            "absent": tuple(absent),
            "reward_sources": sources | {"collision": touch},
            "captured_ns": vehicle.now_ns,
            "decided_ns": vehicle.now_ns - self._period_ns,
        }
