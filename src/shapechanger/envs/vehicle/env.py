"""Car, tank, boat and truck as Gymnasium envs: a whole robot, on simulated pins, in MuJoCo."""

from __future__ import annotations

import dataclasses
import os
import time
from collections.abc import Mapping, Sequence
from typing import Any, Final, Literal

import gymnasium as gym
import numpy as np
from gymnasium.utils import EzPickle
from numpy.typing import NDArray

from shapechanger.errors import MissingExtra, ProfileError, RenderError, WorldError

try:
    import gpiozero as _gpiozero
    import mujoco as _mujoco
except ModuleNotFoundError as error:
    raise MissingExtra(error.name or "mujoco", "sim,robot") from error

from shapechanger.embodiments.vehicles import require_fit
from shapechanger.envs.vehicle.courses import CourseDraw, Courses
from shapechanger.envs.vehicle.demonstrator import Demonstrator
from shapechanger.layout import Layout
from shapechanger.link.messages import Observation
from shapechanger.remote.inbox import Received
from shapechanger.remote.judge import Judge
from shapechanger.remote.senses import Senses
from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.robot.profile.profile import Profile
from shapechanger.tasks.drive import DriveReward
from shapechanger.twin.in_process import InProcessRobot
from shapechanger.worlds.simulation import MujocoWorld

__all__ = ["Steering", "VehicleEnv"]

del _gpiozero, _mujoco  # Only looked for: without them nothing below would say what to install.

Steering = Literal["proportional", "bang"]
"""How the wheels turn: anywhere, or full left, straight and full right only, as in 2017."""


class VehicleEnv(gym.Env[Any, NDArray[np.float32]], EzPickle):
    """Drive fast and hit nothing, with a camera that looks ahead.

    The robot is that of a profile, with its own guard and drivers, on simulated pins: caps, slew,
    reflexes and sensors are those of the robot on the bench. `shapechanger/RemoteVehicle-v1` is the
    same task on hardware, or behind a link.

    ## Action space
    `Box(-1, 1, (2,), float32)`: `[steering, throttle]`; -1 steers left, +1 drives forward. It acts
    for one control period of the profile, 1/20 s.

    ## Observation space
    The camera's picture, RGB, `uint8`, shape (height, width, 3), (120, 160, 3) by default; with
    `state=True` a Dict of `image` and `state`; with `image=False` the state alone. What the numbers
    of the state are is in `observation_layout`.

    ## Reward
    `DriveReward`: metres forward, minus collisions and seconds of being stuck, all as the robot's
    own sensors tell. `info["reward_terms"]` and `info["reward_sources"]` say how it came about.

    ## Start
    At a random place of a course that the seed draws, looking along it, at rest.

    ## End
    Terminated when the bumper touches something, unless the reward says otherwise. Truncated after
    1,000 steps.

    ## Info
    `progress`, metres along the course since the start; `collisions` since the start, of any part
    of the vehicle, also those that no bumper tells; `pose`, (x, y, heading) in m and rad; `course`,
    the seed of the course; and as `RemoteVehicleEnv`: `action_applied`, `stop_reason`, `refused`,
    `armed`, `emergency`, `absent`, `reward_terms`, `reward_sources`.

    Args:
        vehicle: "car", "tank", "boat" or "truck".
        world: "corridor", "yard" or "harbour"; None for where the vehicle is at home.
        robot: A profile, as a path or by its name; None for `lab-` and the vehicle.
        steering: Replaces how the profile steers; None to leave it.
        size: Width and height of the pictures in pixels.
        image: Whether observations have a picture.
        state: Whether observations have the state besides the picture.
        reward: Weights that replace those of the profile, by name.
        courses: "training" or "held-out" for the courses that `reset` draws, or their seeds.
        randomise: Whether `reset` draws light, textures and the camera's pose, too.
        put_back: Whether a vehicle that ran into something is put back on the lane, as a person
            beside it would do, and drives on. A collision then ends nothing.
        lenses: What is wrong with the camera, such as ("night", "dirt"); see
            `shapechanger.worlds.lens`.
        render_mode: "rgb_array" for `render` to give the newest picture.

    Raises:
        UnknownName: If there is no such vehicle, world, profile, weight or lens.
        ProfileError: If the profile moves other parts than the vehicle has.
        WorldError: If the vehicle cannot drive in the world.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 20}  # noqa: RUF012

    def __init__(
        self,
        vehicle: str,
        *,
        world: str | None = None,
        robot: str | os.PathLike[str] | None = None,
        steering: Steering | None = None,
        size: Sequence[int] = (160, 120),
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
        self.render_mode = render_mode
        wide, high = size
        profile = _profile(f"lab-{vehicle}" if robot is None else robot, steering, (wide, high))
        self._draw = CourseDraw(courses, randomise)
        self._world = MujocoWorld(
            vehicle,
            world,
            self._draw.first,
            size=(wide, high) if image or render_mode else None,
            lenses=tuple(lenses),
        )
        require_fit(vehicle, {output.part for output in profile.outputs})
        self._robot = InProcessRobot(profile, self._world, pictures=image)
        welcome = self._robot.welcome
        self._senses = Senses(welcome, (wide, high), image, state)
        self._puts_back = put_back
        ends = {"collision_ends_episode": 0.0} if put_back else {}
        weights = DriveReward.from_weights({**welcome.reward, **(reward or {}), **ends})
        self._judge = Judge(self._senses, weights)
        self.observation_space = self._senses.observation_space
        self.action_space = self._senses.action_space
        self.metadata = {**self.metadata, "render_fps": welcome.control_hz}
        self._last: Observation | None = None
        self._seen = 0

    @property
    def world(self) -> MujocoWorld:
        """The world, for whoever may know the truth."""
        return self._world

    @property
    def action_layout(self) -> Layout:
        """What the numbers of an action mean."""
        return self._senses.action_layout

    @property
    def observation_layout(self) -> Layout:
        """What the numbers of an observation mean; a picture is the one block `camera/image`."""
        return self._senses.observation_layout

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Put the vehicle at a start.

        Args:
            seed: Of the draw of courses, starts and looks.
            options: `course`, the seed of a course, and `start`, the seed of a start on it; what
                is left out is drawn.

        Raises:
            WorldError: If the vehicle does not come to rest at the start.
        """
        super().reset(seed=seed)
        drawn = self._draw.draw(self.np_random, self._world.course.world, options or {})
        if drawn.course != self._world.seed or drawn.look is not None:
            self._world.lay_out(drawn.course, drawn.look, drawn.camera)
        last = self._robot.start(lambda: self._world.place(drawn.start))
        if self._world.touches:
            raise WorldError(
                f"The {self._world.vehicle.name} is stuck at start {drawn.start} of course "
                f"{drawn.course}: choose another."
            )
        self._judge.start(last)
        self._last = last
        return self._view(last), self._info(last)

    def step(self, action: NDArray[np.float32]) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Act for one control period.

        Raises:
            SpaceMismatch: If the action does not fit the robot.
            ResetNeeded: If `reset` was never called.
        """
        before = self._last
        if before is None:
            raise gym.error.ResetNeeded("Call reset() before the first step.")
        values, collisions = self._senses.values(action), self._world.collisions
        seen, bumped = self._robot.step(values)
        terminated, terms = self._judge.judge(before, seen, bumped)
        self._last = seen
        info = self._info(seen) | terms
        info["reward_terms"] = terms
        info["refused"] = self._robot.refused
        if self._puts_back and self._world.collisions > collisions:
            self._world.put_back()
        return self._view(seen), sum(terms.values()), terminated, False, info

    def hold_out(self) -> None:
        """Draw, from the next reset on, courses that no vehicle learns on."""
        self._draw.hold_out()

    def demonstrator(self, seed: int) -> Demonstrator:
        """A driver that knows the whole course, and shows how to drive here.

        Args:
            seed: Of the mistakes that it makes and puts right.
        """
        return Demonstrator(self._world, seed)

    def render(self) -> NDArray[np.uint8] | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """What the camera sees now, shape (height, width, 3); None without a render mode.

        Raises:
            RenderError: If `reset` was never called.
        """
        if self.render_mode is None:
            return None
        if self._last is None:
            raise RenderError("There is nothing to see before the first reset().")
        return self._world.picture()

    def close(self) -> None:
        """Let go of the pins, and free what draws."""
        self._robot.close()
        self._world.close()

    def _view(self, seen: Observation) -> Any:
        return self._senses.view(Received(seen, time.monotonic(), seen.frame)).observation

    def _info(self, seen: Observation) -> dict[str, Any]:
        pose = self._world.pose
        return {
            "action_applied": np.array(seen.action_applied, np.float32),
            "stop_reason": seen.stop_reason,
            "armed": seen.armed,
            "emergency": seen.emergency,
            "reward_sources": self._judge.sources(seen),
            "progress": self._world.progress_m,
            "collisions": self._world.collisions,
            "pose": (pose.x, pose.y, pose.heading),
            "course": self._world.seed,
        }


_LEVELS: Final = {"proportional": "any", "bang": "three"}


def _profile(
    robot: str | os.PathLike[str], steering: Steering | None, size: tuple[int, int]
) -> Profile:
    """The profile, with the steering and the size of pictures that are asked for."""
    profile = load_profile(find_profile(robot))
    if profile.camera is None:
        raise ProfileError(f"{profile.path}: the robot has no camera, and this task needs one.")
    actions = profile.actions
    if [action.name for action in actions] != ["steering", "throttle"]:
        names = ", ".join(action.name for action in actions)
        raise ProfileError(
            f"{profile.path}: a vehicle's actions are steering and throttle, not {names}."
        )
    if steering is not None:
        levels = _LEVELS[steering]
        actions = (dataclasses.replace(actions[0], levels=levels), *actions[1:])
    camera = dataclasses.replace(profile.camera, size=size, flip=False)
    return dataclasses.replace(profile, actions=actions, camera=camera)
