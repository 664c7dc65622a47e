"""Car, tank, boat and truck as Gymnasium envs that see a camera's image and a robot's sensors."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, NamedTuple

import gymnasium as gym
import numpy as np
from gymnasium.utils import EzPickle
from numpy.typing import NDArray

from shapechanger.contract.drive import DriveReward
from shapechanger.errors import RenderError, UnknownName
from shapechanger.layout import Element, Feature, Layout
from shapechanger.vehicles.envs.demonstrators import TeacherDemonstrator
from shapechanger.vehicles.envs.drive import (
    Courses,
    CourseSampler,
    DriveEnv,
    Steering,
    resolve_profile,
)
from shapechanger.vehicles.envs.sensed import SensedVehicle
from shapechanger.vehicles.envs.shift import certify_vehicles
from shapechanger.vehicles.world import MujocoWorld

_MODES: Final = ("rgb_array",)
_ABSENT: Final = "absent"
_APPLIED: Final = "/applied"


class SimulatedRobot(NamedTuple):
    """Facts of a simulated robot for recordings.

    Attributes:
        robot: Name of its profile.
        body: Kind of vehicle.
        camera_pitch_deg: Angle of the camera's axis below the horizon, degrees; None if unknown.
        camera_fovy_deg: Vertical field of view, degrees; None if unknown.
    """

    robot: str
    body: str
    camera_pitch_deg: float | None
    camera_fovy_deg: float | None


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
        if render_mode is not None and render_mode not in _MODES:
            raise UnknownName("render mode", render_mode, _MODES)
        self.render_mode = render_mode
        profile, camera = resolve_profile(vehicle, robot, size, steering)
        self._draw = CourseSampler(courses, randomise)
        self._world = MujocoWorld(
            vehicle,
            world,
            self._draw.first,
            size=camera.size if image or render_mode else None,
            pitch_deg=camera.pitch_deg,
            fovy_deg=camera.fovy_deg,
            lenses=(lenses,) if isinstance(lenses, str) else tuple(lenses),
        )
        self.parts = frozenset(output.part for output in profile.outputs)
        self.welcome = SimulatedRobot(profile.name, profile.body, camera.pitch_deg, camera.fovy_deg)
        ends = {"collision_ends_episode": 0.0} if put_back else {}
        self._reward = DriveReward.from_weights({**profile.reward, **(reward or {}), **ends})
        self._puts_back = put_back
        self._vehicle = SensedVehicle(profile.guard_plan(), self._world)
        self._period_ns = round(1e9 / profile.control_hz)
        self._has_image, self._has_state = image, state or not image
        self._state = profile.state_layout()
        self._applied_at = {
            f"{action.name}{_APPLIED}": i for i, action in enumerate(profile.actions)
        }
        self.action_layout = profile.action_layout()
        wide, high = camera.size
        pixels = Feature(
            "camera/image", "1", 0.0, 255, Element("camera", "camera"), (high, wide, 3)
        )
        self.observation_layout = Layout(
            ((pixels,) if image else ()) + (self._state.features if self._has_state else ())
        )
        state_space, self.action_space = (
            gym.spaces.Box(layout.low.astype(np.float32), layout.high.astype(np.float32))
            for layout in (self._state, self.action_layout)
        )
        image_space = gym.spaces.Box(0, 255, (high, wide, 3), np.uint8)
        self.observation_space: gym.Space[Any] = state_space if not image else image_space
        if image and state:
            self.observation_space = gym.spaces.Dict({"image": image_space, "state": state_space})
        self.metadata = {**self.metadata, "render_fps": profile.control_hz}
        self._needs_reset = True

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start an episode.

        Args:
            seed: Seed of the sampling of courses, starts and looks.
            options: `course`, the seed of a course, and `start`, the seed of a start on it; omitted
                ones are sampled.

        Raises:
            UnknownName: If there is no such option.
            WorldError: If a seed is not a whole number from 0, or the vehicle touches something at
                the start.
        """
        super().reset(seed=seed)
        drawn = self._lay_out(options)
        self._world.zero_odometer()  # So that no episode depends on earlier ones.
        self._world.place(drawn.start)
        self._vehicle.start()
        # A robot sends its first observation after one period, too.
        self._vehicle.advance(self._period_ns, None)
        self._require_free(drawn)
        self._touched = bool(self._touches())
        self._needs_reset = False
        seen, absent = self._observe()
        return seen, self._info(absent)

    def step(self, action: NDArray[np.float32]) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Take one step of one control period.

        Raises:
            SpaceMismatch: If the action is not two finite numbers.
            ResetNeeded: If `reset` was never called.
        """
        if self._needs_reset:
            raise gym.error.ResetNeeded("Call reset() before the first step.")
        values, vehicle = self._values(action), self._vehicle
        collisions, bumps = self._world.collisions, vehicle.bumps
        vehicle.advance(self._period_ns, values)
        touches = self._touches()
        hits = bool(touches) or vehicle.bumps > bumps
        collided = None if touches is None else hits and not self._touched
        self._touched = hits
        stall = vehicle.quantities.get("stall")
        terms = self._reward.terms(
            vehicle.quantities.get("speed"),
            collided,
            None if stall is None else bool(stall),
            self._period_ns / 1e9,
        )
        seen, absent = self._observe()
        info = self._info(absent) | terms
        info["reward_terms"] = terms
        # After the observation, as a person would do who has seen the collision.
        if self._puts_back and self._world.collisions > collisions:
            self._world.put_back()
        return seen, sum(terms.values()), self._reward.ends(collided), False, info

    @property
    def teacher_env(self) -> str:
        """Id of the env in which a teacher for this vehicle learns; see `RangesEnv`."""
        return f"shapechanger/{self._world.vehicle.name.capitalize()}Ranges-v1"

    def taught_by(
        self, act: Callable[[NDArray[Any]], NDArray[Any]], seed: int
    ) -> TeacherDemonstrator:
        """Return a teacher as the demonstrator of this env.

        Args:
            act: Policy of `teacher_env`: maps observations, (n, 11), to actions, (n, 2).
            seed: Seed of its mistakes.

        Raises:
            ProfileError: If the robot has another control rate than the teacher.
        """
        self._require_rate_of_expert()
        return TeacherDemonstrator(self._world, act, seed)

    def render(self) -> NDArray[np.uint8] | None:
        """Return the camera's frame, shape (height, width, 3); None without a render mode.

        Raises:
            RenderError: If `reset` was never called.
        """
        if self.render_mode and self._needs_reset:
            raise RenderError("Call reset() before render().")
        return super().render()

    def _observe(self) -> tuple[Any, tuple[str, ...]]:
        """Return the observation, and the names of the state's features without a measurement."""
        quantities, applied = self._vehicle.quantities, self._vehicle.applied
        state, absent = np.empty(self._state.size, np.float32), list[str]()
        for i, feature in enumerate(self._state.features):
            place = self._applied_at.get(feature.name)
            value = quantities.get(feature.name) if place is None else applied[place]
            if value is None:
                absent.append(feature.name)
            state[i] = feature.middle if value is None else value
        if not self._has_image:
            return state, tuple(absent)
        image = self._world.picture()
        return {"image": image, "state": state} if self._has_state else image, tuple(absent)

    def _touches(self) -> float | None:
        """Return whether sensors say that it touches something, 0 or 1; None if none can say."""
        quantities = self._vehicle.quantities
        return quantities.get("collision", quantities.get("bump"))

    def _info(self, absent: tuple[str, ...]) -> dict[str, Any]:
        vehicle = self._vehicle
        sources = {name: vehicle.sources.get(name, _ABSENT) for name in ("speed", "stall")}
        touch = vehicle.sources.get("collision", vehicle.sources.get("bump", _ABSENT))
        return self._truth(self._world.progress_m) | {
            "action_applied": np.array(vehicle.applied, np.float32),
            "stop_reason": vehicle.reason,
            "refused": "",
            "armed": True,
            "emergency": False,
            "absent": absent,
            "reward_sources": sources | {"collision": touch},
            "captured_ns": vehicle.now_ns,
            "decided_ns": vehicle.now_ns - self._period_ns,
        }
