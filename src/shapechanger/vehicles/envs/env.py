"""Car, tank, boat and truck as Gymnasium envs: a whole robot, on simulated pins, in MuJoCo."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from importlib.util import find_spec
from typing import Any, Final

import gymnasium as gym
import numpy as np
from gymnasium.utils import EzPickle
from numpy.typing import NDArray

from shapechanger.contract.drive import DriveReward
from shapechanger.errors import MissingExtra, RenderError, UnknownName
from shapechanger.layout import Layout
from shapechanger.link.messages import Observation, Welcome
from shapechanger.remote.inbox import Received
from shapechanger.remote.observations import RobotSpaces, StepMeter, View
from shapechanger.twin.in_process import InProcessRobot
from shapechanger.vehicles.envs.base import (
    Courses,
    CourseSampler,
    DrivingEnv,
    Steering,
    resolve_profile,
)
from shapechanger.vehicles.envs.demonstrators import TeacherDemonstrator
from shapechanger.vehicles.envs.shift import certify_vehicles
from shapechanger.vehicles.world import MujocoWorld

_MODES: Final = ("rgb_array",)


class VehicleEnv(DrivingEnv):
    """Drive fast without collisions, with a camera that looks ahead.

    The robot is defined by a profile and runs its own guard and drivers on simulated pins: caps,
    slew, reflexes and sensors are those of the robot on the bench. `shapechanger/RemoteVehicle-v1`
    is the same task on hardware, or over the link.

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
        if find_spec("gpiozero") is None:  # The drivers import it when they open their pins.
            raise MissingExtra("gpiozero", "robot")
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
        self._robot = InProcessRobot(profile, self._world, pictures=image)
        welcome = self._robot.welcome
        self._senses = RobotSpaces(welcome, camera.size, image, state)
        self._puts_back = put_back
        ends = {"collision_ends_episode": 0.0} if put_back else {}
        self._reward = DriveReward.from_weights({**welcome.reward, **(reward or {}), **ends})
        self._meter = StepMeter(self._senses)
        self.observation_space = self._senses.observation_space
        self.action_space = self._senses.action_space
        self.metadata = {**self.metadata, "render_fps": welcome.control_hz}
        self._last: Observation | None = None

    @property
    def welcome(self) -> Welcome:
        """Description of the robot, as it gives it to a client."""
        return self._robot.welcome

    @property
    def action_layout(self) -> Layout:
        """Name, unit and range of each number of the action."""
        return self._senses.action_layout

    @property
    def observation_layout(self) -> Layout:
        """Name, unit and range of each number of the observation; a frame is `camera/image`."""
        return self._senses.observation_layout

    @property
    def newest_jpeg(self) -> bytes | None:
        """The JPEG frame of the newest observation, as the robot sent it; None without one."""
        return None if self._last is None or not self._senses.has_image else self._last.frame

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
        last = self._robot.start(lambda: self._world.place(drawn.start))
        self._require_free(drawn)
        self._meter.start(last)
        self._last = last
        view = self._view(last)
        return view.observation, self._info(last, view)

    def step(self, action: NDArray[np.float32]) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Take one step of one control period.

        Raises:
            SpaceMismatch: If the action does not fit the robot.
            ResetNeeded: If `reset` was never called.
        """
        before = self._last
        if before is None:
            raise gym.error.ResetNeeded("Call reset() before the first step.")
        values, collisions = self._senses.values(action), self._world.collisions
        seen, bumped = self._robot.step(values)
        measured = self._meter.measure(before, seen, bumped)
        terms = self._reward.terms(*measured)
        terminated = self._reward.ends(measured.collided)
        self._last = seen
        view = self._view(seen)
        info = self._info(seen, view) | terms
        info["reward_terms"] = terms
        info["refused"] = self._robot.refused
        if self._puts_back and self._world.collisions > collisions:
            self._world.put_back()
        return view.observation, sum(terms.values()), terminated, False, info

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
        if self.render_mode and self._last is None:
            raise RenderError("Call reset() before render().")
        return super().render()

    def close(self) -> None:
        """Release the pins and the renderer."""
        self._robot.close()
        super().close()

    def _view(self, seen: Observation) -> View:
        return self._senses.view(Received(seen, time.monotonic(), seen.frame))

    def _info(self, seen: Observation, view: View) -> dict[str, Any]:
        pose = self._world.pose
        return {
            "action_applied": np.array(seen.action_applied, np.float32),
            "stop_reason": seen.stop_reason,
            "armed": seen.armed,
            "emergency": seen.emergency,
            "absent": view.absent,
            "reward_sources": self._meter.sources(seen),
            "progress": self._world.progress_m,
            "collisions": self._world.collisions,
            "pose": (pose.x, pose.y, pose.heading),
            "course": self._world.seed,
            "standing": self._world.inputs().stands,
            "captured_ns": seen.captured_ns,
            "decided_ns": seen.command_ns,
        }
