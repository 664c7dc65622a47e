"""Tasks for users' robots: built-in ones, and the interface of custom ones.

A task is any object with a method `reward`, or a function:

>>> class Jump:
...     observe = ("torso/z", "*/angle", "*/velocity")
...
...     def reward(self, robot):
...         return {"height": robot.height, "control": -0.1 * float((robot.action**2).sum())}
...
...     def terminated(self, robot):
...         return robot.up < 0.0
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, ClassVar, Final, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from shapechanger.contract.env_ref import FORWARD_SPEED, RETURN, Measure
from shapechanger.errors import TaskError, UnknownName

_Floats = NDArray[np.float64]


@dataclass(slots=True)
class RobotState:
    """State of a robot after a step, for a task.

    Attributes:
        model: MuJoCo's model.
        data: MuJoCo's data.
        dt: Duration of a step, s.
        place: Origin of the trunk in the world, shape (3,), m. The robot consists of all bodies
            that the actuators move. Its trunk is the body that can travel, or the first body of a
            robot that is fixed to the world.
        velocity: Mean velocity of that point over the step, shape (3,), m/s.
        up: Vertical part of the axis of the trunk that points up at the start: 1 upright, 0 on its
            side, -1 upside down.
        action: The action, shape (nu,).
        scaled_action: The action from -1 to 1 over the range of each actuator, shape (nu,).
        standing_height: Height of the trunk above the floor when it stands, m; None for a robot
            that does not stand.
        can_travel: Whether the trunk has a free joint, or a slide without limits on the world.
        numbers: Function that returns any number that can be observed, given its name.
        floor: Height in the world of the floor below the start, m; 0 without a floor.
    """

    model: Any
    data: Any
    dt: float
    place: _Floats
    velocity: _Floats
    up: float
    action: NDArray[Any]
    scaled_action: NDArray[Any]
    standing_height: float | None
    can_travel: bool
    numbers: Callable[[str], float]
    floor: float = 0.0

    @property
    def height(self) -> float:
        """Height of the trunk above the floor below the start, m."""
        return float(self.place[2]) - self.floor

    def __getitem__(self, name: str) -> float:
        """Return a number by its name in the layout, such as `knee/angle`, even if unobserved.

        Raises:
            UnknownName: If the robot has no such number.
        """
        return self.numbers(name)


class OwnTask(Protocol):
    """A task. It must have `reward`, and may have the attributes below.

    - `observe`: names or globs of the numbers to observe, such as `("*/angle", "*/contact/*")`; by
      default all positions and velocities, except the position on the floor.
    - `terminated(robot)`: whether the episode ends; by default never.
    - `measures`: metrics of a policy (`shapechanger.contract.env_ref`), the default first.
    - `check(robot)`: called once with the robot at its start; raises `TaskError` if the robot does
      not fit.
    """

    def reward(self, robot: RobotState, /) -> Mapping[str, float]:
        """Return the terms of the reward, keyed by name; the reward is their sum."""
        ...


@dataclass
class Walk:
    """Walk or run forwards along x, like Gymnasium's runners.

    Attributes:
        forward: Reward per m/s.
        alive: Reward of each step in which the robot is healthy.
        control: Cost of the sum of squares of the actions, each scaled to -1 to 1.
        least_height: Share of its standing height below which the robot counts as fallen.
        least_up: Vertical part of its up axis below which it counts as fallen: 0 permits a tilt of
            90 degrees.
        terminate: Whether an episode ends when the robot has fallen.
    """

    measures: ClassVar[tuple[Measure, ...]] = (FORWARD_SPEED, RETURN)

    forward: float = 1.0
    alive: float = 1.0
    control: float = 0.1
    least_height: float = 0.4
    least_up: float = 0.0
    terminate: bool = True

    def check(self, robot: RobotState) -> None:
        """Require a robot that can travel, on a floor."""
        if not robot.can_travel:
            raise TaskError(
                "The task 'walk' needs a robot that can travel, and this one is fixed to the "
                "world: give it a free joint with rig=AddFreeJoint(BODY), or another task."
            )
        if robot.standing_height is None:
            raise TaskError(
                "The task 'walk' needs a floor, and this robot would fall through the world: give "
                "it one with rig=AddFloor(), or let its geoms touch the floor that it has."
            )

    def healthy(self, robot: RobotState) -> bool:
        """Return whether the robot has not fallen."""
        lowest = self.least_height * (robot.standing_height or 0.0)
        return robot.height >= lowest and robot.up >= self.least_up

    def reward(self, robot: RobotState) -> Mapping[str, float]:
        """Return the terms `forward`, `alive` and `control`."""
        return {
            "forward": self.forward * float(robot.velocity[0]),
            "alive": self.alive * self.healthy(robot),
            "control": -self.control * float(np.square(robot.scaled_action).sum()),
        }

    def terminated(self, robot: RobotState) -> bool:
        """Return whether the robot has fallen."""
        return self.terminate and not self.healthy(robot)


BUILT_IN: Final[Mapping[str, type[OwnTask]]] = {"walk": Walk}
"""Tasks, keyed by name."""


def as_task(task: Any, options: Mapping[str, Any] | None = None) -> tuple[OwnTask, str]:
    """Return a task and its name for messages; `OwnRobotEnv` lists the forms of a task.

    Options are the arguments of a class or of a built-in task.
    """
    found = _found(task) if isinstance(task, str) else task
    name = task if isinstance(task, str) else getattr(task, "__qualname__", type(task).__qualname__)
    rewards = callable(getattr(found, "reward", None))
    is_function = callable(found) and not rewards and not isinstance(found, type)
    # Checked first, because a name from a file must not create arbitrary objects.
    if not is_function and not rewards:
        raise TaskError(
            f"The task {name!r} has no method `reward(robot)` that returns a dict of reward terms."
        )
    if isinstance(found, type):
        try:
            found = found(**(options or {}))
        except TypeError as error:
            raise TaskError(f"The task {name!r} cannot be made: {error}.") from error
    elif options:
        raise TaskError(f"The task {name!r} is not a class, so it takes no options.")
    return cast("OwnTask", SimpleNamespace(reward=found) if is_function else found), name


def reference(task: Any) -> Any:
    """Return `module:Name` of a class or function, for JSON, or else the task itself."""
    module, name = getattr(task, "__module__", ""), getattr(task, "__qualname__", "")
    importable = module != "__main__" and name.isidentifier() and not isinstance(task, str)
    return f"{module}:{name}" if importable else task


def _found(name: str) -> Any:
    """Return a built-in task, or the object that `module:Name` names."""
    module_name, colon, attribute = name.partition(":")
    if not colon:
        if name not in BUILT_IN:
            raise UnknownName("task", name, (*BUILT_IN, "module:Name"))
        return BUILT_IN[name]
    try:
        module = importlib.import_module(module_name)
    except ModuleNotFoundError as error:
        raise TaskError(f"The task {name!r} is not found: {error}.") from error
    if not hasattr(module, attribute):
        known = [each for each in vars(module) if not each.startswith("_")]
        raise UnknownName(f"name in {module_name}", attribute, known)
    return getattr(module, attribute)


def reward_terms(task: OwnTask, name: str, robot: RobotState) -> dict[str, float]:
    """Return the terms of the reward of a step, or refuse them unless they are finite numbers."""
    given: Any = task.reward(robot)
    if not isinstance(given, Mapping):
        raise TaskError(
            f"The task {name!r} returns {type(given).__name__} as reward: return a dict of terms, "
            'such as {"forward": 1.0}.'
        )
    terms: dict[str, float] = {}
    for term, value in cast("Mapping[str, Any]", given).items():
        number = np.asarray(value)
        if number.ndim or number.dtype.kind not in "biuf" or not np.isfinite(number):
            raise TaskError(
                f"The reward term {term!r} of the task {name!r} is {value!r}: it must be one "
                "finite number."
            )
        terms[term] = float(number)
    return terms


def has_ended(task: OwnTask, name: str, robot: RobotState) -> bool:
    """Return whether a task ends the episode; raise a TaskError unless it returns a boolean."""
    terminated: Any = getattr(task, "terminated", None)
    answer: Any = terminated is not None and terminated(robot)
    if not isinstance(answer, bool | np.bool_):
        raise TaskError(
            f"`terminated` of the task {name!r} returns {answer!r}: it must be True or False."
        )
    return bool(cast("Any", answer))


def observed(task: OwnTask) -> Sequence[str] | None:
    """Return the names and globs that a task observes; None for the default."""
    given: Any = getattr(task, "observe", None)
    names: list[Any] = [] if given is None or isinstance(given, str) else list(given)
    if given is not None and not (names and all(isinstance(each, str) for each in names)):
        raise TaskError(f"`observe` must be a list of names or globs of numbers, got {given!r}.")
    return names or None
