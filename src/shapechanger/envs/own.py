"""Env of a user's robot, from an MJCF or URDF file, with an optional task of the user."""

from __future__ import annotations

import importlib
import importlib.util
import re
from collections.abc import Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from os import fspath
from pathlib import Path
from typing import Any, Final, cast

import gymnasium as gym
import numpy as np
from gymnasium.utils import EzPickle
from numpy.typing import NDArray

from shapechanger.errors import (
    BrokenModel,
    EnvArgumentError,
    MorphologyError,
    UnknownName,
    needing_extra,
    require_known,
)

with needing_extra("sim"):
    import mujoco
    from gymnasium.envs.mujoco import MujocoEnv

from shapechanger.contract.env_ref import RETURN, Measure
from shapechanger.envs.catalogue import MODEL_FILES, OWN_ROBOT
from shapechanger.envs.checks import check_action
from shapechanger.envs.layouts import body_features, position_features, velocity_features
from shapechanger.envs.own_tasks import (
    RobotState,
    as_task,
    has_ended,
    observed,
    reference,
    reward_terms,
)
from shapechanger.envs.reshapable import Reshapable
from shapechanger.layout import Feature
from shapechanger.morphology import Body, as_body, name_elements, reason_of, reshape, to_json
from shapechanger.morphology.families import BodyLike, Family, compiling
from shapechanger.morphology.pose import (
    StartRules,
    floor_height,
    posed,
    robot_bodies,
    standing_height,
    start_pose,
    travelling_body,
    trunk_lift,
)

_Floats = NDArray[np.float64]

# Names of robots in `robot_descriptions`: they are the names of its modules.
_DESCRIPTION: Final = re.compile(r"[A-Za-z0-9_]+_description")
_PACKAGE: Final = "robot_descriptions"
# Path schemes of ROS and Gazebo.
_IN_PACKAGE: Final = re.compile(r"(package|model)://+(?P<name>[^/]+)/(?P<rest>.+)")

# Target duration of an action, s, rounded to whole physics steps; Gymnasium's runners take 8 to
# 50 ms.
_CONTROL_STEP_S: Final = 0.02
# Name of the start pose in common collections of models.
_HOME: Final = "home"
_J: Final = mujoco.mjtJoint


@dataclass(frozen=True)
class OwnFamily(Family):
    """The bodies that edits make from a user's robot.

    Attributes:
        path: The robot's file. Families are the same only if file and rig are the same.
    """

    path: Path = Path()

    @property
    def key(self) -> str:
        """The file and the rig: only bodies with the same key can be interpolated."""
        return f"{self.path}{to_json(self.rig) if self.rig else ''}"

    def load(self, path: str | Path) -> mujoco.MjSpec:
        """Load a model with the rig, and name all its elements.

        A file that a URDF names as `package://NAME/REST` is searched in each folder NAME that
        contains the URDF, or that lies next to a folder that contains the URDF.

        Raises:
            BrokenModel: If MuJoCo cannot read or compile the model, a mesh is a COLLADA file, or no
                folder has a file of a package.
            MorphologyError: If the rig does not fit the model.
        """
        with compiling(f"read {Path(path).name}"):
            spec = mujoco.MjSpec.from_file(str(path))
        _find_packages(spec, Path(path))
        # By default, MuJoCo would merge the base of a URDF into the world, and lose its names.
        spec.compiler.fusestatic = False
        name_elements(spec)
        with compiling(f"compile {Path(path).name}"):
            return reshape(spec, self.rig)


def _find_packages(spec: mujoco.MjSpec, path: Path) -> None:
    """Replace paths that only ROS and Gazebo resolve by paths of files; refuse COLLADA meshes."""
    for element in (*spec.meshes, *spec.textures):
        if element.file.lower().endswith(".dae"):
            raise BrokenModel(
                f"{path.name} names the mesh {element.file}, and MuJoCo does not read COLLADA: "
                "convert it to OBJ or STL."
            )
        package = _IN_PACKAGE.fullmatch(element.file)
        if package is None:
            continue
        name, rest = package["name"], package["rest"]
        folders = (each if each.name == name else each / name for each in path.resolve().parents)
        found = next((folder / rest for folder in folders if (folder / rest).is_file()), None)
        if found is None:
            raise BrokenModel(
                f"{path.name} names the file {element.file}, and {rest} is in no folder {name!r} "
                f"that contains {path.name} or lies next to a folder that contains it: copy the "
                f"package's folder next to {path.name}, or write a path relative to it."
            )
        element.file = str(found)


def own_family(path: str | Path, rig: Body = ()) -> OwnFamily:
    """Return the family of a user's robot.

    Args:
        path: An MJCF or URDF file, or a name of the package `robot_descriptions`, such as
            `go2_mj_description`, which downloads it.
        rig: Edits that are applied before those of any body.

    Raises:
        UnknownName: If there is no such file, or the package has no robot of this name.
        MorphologyError: If the path is a folder, or the package is missing or fails.
    """
    file = Path(path).expanduser()
    if not file.is_file():
        if _DESCRIPTION.fullmatch(str(path)):
            file = _described(str(path))
        elif file.is_dir():
            raise MorphologyError(f"{path} is a folder: name a file of MJCF or URDF in it.")
        else:
            models = (each for each in file.parent.glob("*") if each.suffix in MODEL_FILES)
            known = sorted(each.name for each in models)
            raise UnknownName(f"model in {file.parent.resolve()}", file.name, known)
    return OwnFamily(file.stem, {file.stem: ()}, path=file.resolve(), rig=rig)


def _described(name: str) -> Path:
    if importlib.util.find_spec(_PACKAGE) is None:
        raise MorphologyError(
            f"{name} looks like a robot of the package {_PACKAGE}, which is not installed: run "
            f"`pip install {_PACKAGE}`."
        )
    if importlib.util.find_spec(f"{_PACKAGE}.{name}") is None:
        known: Any = importlib.import_module(f"{_PACKAGE}._descriptions").DESCRIPTIONS
        raise UnknownName(f"robot of {_PACKAGE}", name, list(known))
    try:
        module = importlib.import_module(f"{_PACKAGE}.{name}")
    except Exception as error:  # Git, network and file errors of several packages.
        raise MorphologyError(f"{_PACKAGE} cannot fetch {name}: {reason_of(error)}.") from error
    file = getattr(module, "MJCF_PATH", None) or getattr(module, "URDF_PATH", None)
    if file is None:
        raise MorphologyError(f"{name} of {_PACKAGE} has neither MJCF nor URDF.")
    return Path(file)


def require_robot(model: mujoco.MjModel, path: Path) -> None:
    """Raise a MorphologyError unless a model has joints, and actuators with ranges."""
    if not model.njnt:
        raise MorphologyError(f"{path.name} has no joints, so it cannot move.")
    if not model.nu:
        motors = "rig=AddMotor('*')" if path.suffix == ".urdf" else "rig=AddMotor('*', GEAR)"
        raise MorphologyError(
            f"{path.name} has no actuators: add them to the file, or motors with {motors}."
        )
    if unlimited := np.flatnonzero(model.actuator_ctrllimited == 0).tolist():
        raise MorphologyError(
            f"These actuators of {path.name} have no ctrlrange, so their range is unknown: "
            f"{', '.join(model.actuator(i).name for i in unlimited)}."
        )


class OwnRobotEnv(Reshapable, EzPickle):
    """A robot from an MJCF or URDF file, with a built-in or custom task.

    The robot consists of all bodies that the actuators move, see
    `shapechanger.morphology.pose.robot_bodies`. Only the robot has a trunk and a standing height,
    starts with noise, and is lifted to the floor; objects keep their start pose in the file.

    ## Action space
    One number per actuator, `float32`, within its `ctrlrange`; `action_layout` has names, units and
    gains. An action lasts 20 ms, or `frame_skip` physics steps. For the dog of
    `docs/own-bodies.md`, `Box(-1, 1, (2,), float32)`:

    | Num | Action        | Min | Max | Unit |
    | --- | ------------- | --- | --- | ---- |
    | 0   | `front/motor` | -1  | 1   | 1    |
    | 1   | `back/target` | -1  | 1   | rad  |

    ## Observation space
    Positions and velocities of all joints, without the position of the trunk on the floor; or the
    numbers in the task's `observe`. `observation_layout` names each number. For the same dog,
    `Box(-inf, inf, (15,), float64)`:

    | Num   | Observation        | Min    | Max   | Unit  |
    | ----- | ------------------ | ------ | ----- | ----- |
    | 0     | `trunk/z`          | -inf   | inf   | m     |
    | 1-4   | `trunk/qw` to `qz` | -1     | 1     | 1     |
    | 5     | `front/angle`      | -1.047 | 1.047 | rad   |
    | 6     | `back/angle`       | -1.047 | 1.047 | rad   |
    | 7-9   | `trunk/vx` to `vz` | -inf   | inf   | m/s   |
    | 10-12 | `trunk/wx` to `wz` | -inf   | inf   | rad/s |
    | 13    | `front/velocity`   | -inf   | inf   | rad/s |
    | 14    | `back/velocity`    | -inf   | inf   | rad/s |

    ## Reward
    The sum of the terms that the task returns. For the task `walk`, whose weights `task_options`
    replaces, with the trunk's velocity along x, v, m/s, and actions scaled to -1 to 1, a:

    ```text
    reward_forward =  1 v
    reward_alive   =  1 unless the robot has fallen
    reward_control = -0.1 sum(a^2)
    ```

    ## Start
    The keyframe `home` if the model has one, else the model's own pose with each joint at least a
    tenth of its range inside its limits, with noise of `reset_noise_scale`; the feet stand above
    the floor, and the equations of coupled joints and closed loops hold as exactly as in the file.
    The standing height is the height in this pose without noise.

    ## End
    Terminated when the task ends it, or when the simulation diverges, with a reward of 0. The task
    `walk` ends when the trunk is lower than 0.4 times its standing height or tilts by more than 90
    degrees. Truncated after 1,000 steps, or `max_episode_steps` of `gym.make`.

    ## Info
    `x_position` and `y_position` of the trunk, m; `x_velocity` and `y_velocity`, m/s; the terms of
    the reward as `reward_...`. `diverged` if the simulation has diverged.

    ## Versions
    v1: the first.

    Args:
        path: An MJCF or URDF file, or a name of the package `robot_descriptions`.
        task: `walk`, or your own task: `module:Name`, a class, a function or an object; see
            `shapechanger.envs.own_tasks`.
        task_options: Arguments of the task's class.
        body: Edits of `shapechanger.morphology`, or their JSON; the unedited robot by default.
        rig: Edits that are applied before those of any body, such as `AddMotor("*")` and
            `AddFloor()`, or their JSON.
        frame_skip: Physics steps per action; None for a step of 20 ms.
        reset_noise_scale: Half-width of the uniform noise of the start pose, rad and m, and
            standard deviation of the noise of its velocities, rad/s and m/s.
        **arguments: See the section Common arguments of this page.

    Attributes:
        task: The task.
        task_name: Name of the task.
        measures: Metrics of a policy, the default first.
        reset_noise_scale: The argument of this name.
    """

    # `gym.make` reads the modes from the class; the rate of the frames depends on the model.
    metadata: dict[str, Any] = {  # noqa: RUF012 - Gymnasium declares it without ClassVar.
        "render_modes": ["human", "rgb_array", "depth_array", "rgbd_tuple"]
    }
    measures: tuple[Measure, ...]
    _draws_bare_floors = True
    _as_json = frozenset({"path", "task", "rig"})

    def __init__(
        self,
        path: str | Path = "",
        task: Any = "walk",
        task_options: Mapping[str, Any] | None = None,
        body: BodyLike = (),
        rig: BodyLike = (),
        frame_skip: int | None = None,
        reset_noise_scale: float = 0.05,
        **arguments: Any,
    ) -> None:
        if not str(path):
            raise EnvArgumentError(f"{OWN_ROBOT} needs the file of a robot: give path=FILE.")
        self.task, self.task_name = as_task(task, task_options)
        self._observed = observed(self.task)
        self.measures = getattr(self.task, "measures", (RETURN,))
        if not 0.0 <= reset_noise_scale < np.inf:
            raise EnvArgumentError(
                f"reset_noise_scale must be a number of at least 0, got {reset_noise_scale!r}."
            )
        self.reset_noise_scale = float(reset_noise_scale)
        self.family = self._file = own_family(path, as_body(rig))
        self._begin(body, arguments)
        spec = self.family.load(self._file.path)
        with compiling(f"compile {self._file.path.name}"):
            plain = spec.copy().compile()
        has_home = mujoco.mj_name2id(plain, mujoco.mjtObj.mjOBJ_KEY, _HOME) >= 0
        # The joints that the keyframe poses; edits may add others.
        self._home = {plain.joint(j).name for j in range(plain.njnt)} if has_home else set[str]()
        if frame_skip is None:
            frame_skip = max(1, round(_CONTROL_STEP_S / spec.option.timestep))
        if frame_skip < 1:
            raise EnvArgumentError(f"frame_skip must be at least 1, got {frame_skip}.")
        # `_finish` replaces the space by the space of the layout.
        space = gym.spaces.Box(-np.inf, np.inf, (0,), np.float64)
        cast("Any", MujocoEnv).__init__(self, str(self._file.path), frame_skip, space, **arguments)
        self.metadata = {**self.metadata, "render_fps": round(1.0 / self.dt)}
        self._finish(arguments)
        self._ezpickle_kwargs |= {
            "path": fspath(path),
            "task": reference(task),
            "task_options": task_options,
            "rig": to_json(self._file.rig),
            "frame_skip": frame_skip,
            "reset_noise_scale": reset_noise_scale,
        }
        self.set_state(self.init_qpos, self.init_qvel)
        self._started = False
        check = getattr(self.task, "check", None)
        if check is not None:
            check(self.seen(np.zeros(self.model.nu), self.trunk_place()))

    def _initialize_simulation(self) -> tuple[mujoco.MjModel, mujoco.MjData]:
        model, data = super()._initialize_simulation()
        require_robot(model, self._file.path)
        return model, data

    def _start_and_height(self, model: mujoco.MjModel) -> tuple[_Floats, float | None]:
        pose = start_pose(model)
        if self._home:
            # Edits change the keyframe too, so it has `StartHeight` and the poses of copied limbs;
            # joints that it does not pose stay inside their limits.
            home = model.key(_HOME).qpos
            for j, at in enumerate(np.split(np.arange(model.nq), model.jnt_qposadr[1:])):
                if model.joint(j).name in self._home or np.any(home[at] != model.qpos0[at]):
                    pose[at] = home[at]
            # Lift the robot to the floor, in case an edit has enlarged it.
            pose = StartRules(model).feasible(pose, mujoco.MjData(model), pose)
        # Measured in the start pose, because joints in the middle of their ranges fold many legs.
        height, trunk = standing_height(model, pose), travelling_body(model)
        if height is None and trunk is not None and trunk_lift(model) is None:
            # For example a base on wheels that slides in a plane: it keeps its height.
            height = float(posed(model, pose).xpos[trunk, 2])
        return pose, None if height is None else height - floor_height(model, pose)

    def _follow_body(self) -> None:
        model = self.model
        travelling = travelling_body(model)
        self._can_travel = travelling is not None
        self._trunk = travelling or int(model.body_rootid[np.argmax(robot_bodies(model))])
        super()._follow_body()
        self._floor = floor_height(model, self.init_qpos)
        at_start = posed(model, self.init_qpos)
        self._up_axis = at_start.xmat[self._trunk].reshape(3, 3)[2].copy()
        low, high = self.action_layout.low, self.action_layout.high
        self._middle, self._half_range = 0.5 * (low + high), 0.5 * (high - low)

    def _observation_features(self, model: mujoco.MjModel) -> list[Feature]:
        features = [*position_features(model), *velocity_features(model)]
        features += body_features(model, "contact")
        names = [feature.name for feature in features]
        places = sorted({*range(model.nq + model.nv)} - _place_on_floor(model))
        if self._observed is not None:
            each = [
                {i for i, name in enumerate(names) if name == one or fnmatchcase(name, one)}
                for one in self._observed
            ]
            if not all(each):
                missing = self._observed[each.index(set())]
                raise UnknownName("observed number", missing, names)
            places = sorted(set[int]().union(*each))
        self._places = np.array(places, np.intp)
        self._place_of = {name: place for place, name in enumerate(names)}
        return [features[place] for place in places]

    def step(self, action: Any) -> Any:
        """Take one step, as `Reshapable.step`, with the task's reward and end."""
        action = check_action(self, action)
        self._require_reset("step")
        before = self.trunk_place()
        cast("Any", self).do_simulation(action, self.frame_skip)
        robot, diverged = self.seen(action, before), self.diverged
        # A diverged state is not the task's fault, so the task is not called.
        terms = {} if diverged else reward_terms(self.task, self.task_name, robot)
        terminated = diverged or has_ended(self.task, self.task_name, robot)
        info = self._get_reset_info()
        info["x_velocity"], info["y_velocity"] = robot.velocity[:2].tolist()
        info |= {f"reward_{name}": value for name, value in terms.items()}
        if diverged:
            info["diverged"] = True
        if self.render_mode == "human":
            self.render()
        return self._get_obs(), sum(terms.values(), 0.0), terminated, False, info

    def _draw_start(self) -> _Floats:
        scale, rules = self.reset_noise_scale, self.start_rules()
        # No noise is drawn for objects, so that a robot starts the same with and without them.
        place, speed = self.init_qpos.copy(), self.init_qvel.copy()
        moved, pushed = int(rules.robot_places.sum()), int(rules.robot_dofs.sum())
        place[rules.robot_places] += self.np_random.uniform(-scale, scale, moved)
        speed[rules.robot_dofs] += scale * self.np_random.standard_normal(pushed)
        self.set_state(place, speed)
        return self._get_obs()

    def _get_obs(self) -> _Floats:
        return self._all_numbers()[self._places]

    def _get_reset_info(self) -> dict[str, Any]:
        x, y, _ = self.trunk_place().tolist()
        return {"x_position": x, "y_position": y}

    def _all_numbers(self) -> _Floats:
        """Return all numbers that can be observed, in the order of the names."""
        data = self.data
        return np.concatenate([data.qpos, data.qvel, data.cfrc_ext[1:].ravel()])

    def _number(self, name: str) -> float:
        require_known(f"number of {self.family.name}", self._place_of, name)
        return float(self._all_numbers()[self._place_of[name]])

    def trunk_place(self) -> _Floats:
        """Return the place of the trunk in the world, shape (3,), m, as of the last step."""
        return self.data.xpos[self._trunk].copy()

    def seen(self, action: NDArray[Any], before: _Floats) -> RobotState:
        """Return the state for a task after an action; `before` is the trunk's former place, m."""
        place = self.trunk_place()
        return RobotState(
            *(self.model, self.data, self.dt, place, (place - before) / self.dt),
            float(self._up_axis @ self.data.xmat[self._trunk].reshape(3, 3)[2]),
            *(action, (action - self._middle) / self._half_range),
            *(self.standing_height, self._can_travel, self._number, self._floor),
        )

    @property
    def label(self) -> str:
        """Name of the file without its suffix, for certificates."""
        return self.family.name

    @property
    def family_name(self) -> str:
        """The file and the rig, which must be the same to interpolate between two bodies."""
        return self._file.key


def _place_on_floor(model: mujoco.MjModel) -> set[int]:
    """Return the indices in qpos of the coordinates that move the trunk over the floor."""
    trunk, lift = travelling_body(model), trunk_lift(model)
    hidden: set[int] = set()
    for joint in np.flatnonzero(model.jnt_bodyid == (-1 if trunk is None else trunk)).tolist():
        place, kind = int(model.jnt_qposadr[joint]), model.jnt_type[joint]
        if kind == _J.mjJNT_FREE:
            hidden |= {place, place + 1}
        elif kind == _J.mjJNT_SLIDE and not model.jnt_limited[joint]:
            hidden |= {place} - ({lift.place} if lift else set())
    return hidden


def from_mjcf(
    path: str | Path,
    task: Any = "walk",
    *,
    body: BodyLike = (),
    rig: BodyLike = (),
    task_options: Mapping[str, Any] | None = None,
    max_episode_steps: int = 1000,
    **arguments: Any,
) -> gym.Env[Any, Any]:
    """Make an env of your robot and task; `gymnasium.make` makes the same env.

    Args:
        path: An MJCF or URDF file, or a name of the package `robot_descriptions`, such as
            `go2_mj_description`, which downloads it.
        task: As in `OwnRobotEnv`. Worker processes need one that they can import.
        body: As in `OwnRobotEnv`.
        rig: As in `OwnRobotEnv`.
        task_options: Arguments of the task's class.
        max_episode_steps: Steps after which an episode is truncated.
        **arguments: More arguments of `OwnRobotEnv`, such as `frame_skip` or `render_mode`.

    Raises:
        UnknownName: If there is no such file, task, edit or argument.
        MorphologyError: If the file cannot be read or compiled, or is not a robot that can be
            controlled.
        TaskError: If the task cannot be made or does not fit the robot.
    """
    file = Path(path).expanduser()
    # With an absolute path, a spec makes the same env from any folder.
    where = str(file.resolve()) if file.is_file() else fspath(path)
    given = {"body": body and to_json(as_body(body)), "rig": rig and to_json(as_body(rig))}
    given |= {"path": where, "task": reference(task), "task_options": task_options}
    given = {name: value for name, value in given.items() if value}
    return gym.make(OWN_ROBOT, max_episode_steps=max_episode_steps, **given, **arguments)
