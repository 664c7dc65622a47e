"""Tasks of the user's own: how they are found, and what they must return."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from shapechanger.contract.env_ref import FORWARD_SPEED
from shapechanger.envs.own_tasks import (
    RobotState,
    Walk,
    as_task,
    has_ended,
    observed,
    reference,
    reward_terms,
)
from shapechanger.errors import TaskError, UnknownName


class Still:
    """Stand still."""

    observe = ("torso/z",)

    def __init__(self, weight: float = 1.0) -> None:
        self.weight = weight

    def reward(self, robot: RobotState) -> dict[str, float]:
        return {"still": -self.weight * abs(robot.velocity[0])}


def climb(robot: RobotState) -> dict[str, float]:
    return {"height": robot.height}


NOTHING = 3


def robot(**changes: Any) -> RobotState:
    """Return a robot that walks upright at 2 m/s."""
    fields: dict[str, Any] = {
        "model": None,
        "data": None,
        "dt": 0.02,
        "place": np.array([1.0, 0.0, 0.5]),
        "velocity": np.array([2.0, 0.0, 0.0]),
        "up": 1.0,
        "action": np.array([10.0, 0.0]),
        "scaled_action": np.array([1.0, 0.0]),
        "standing_height": 0.5,
        "can_travel": True,
        "numbers": {"knee/angle": 0.3}.__getitem__,
    }
    return RobotState(**(fields | changes))


def test_a_robot_has_a_height_and_the_number_of_any_name() -> None:
    assert robot().height == 0.5
    assert robot()["knee/angle"] == 0.3


def test_a_task_is_found_by_name_class_function_or_object() -> None:
    """Classes take options; each task has a name for messages."""
    walk, name = as_task("walk", {"forward": 2.0})
    assert isinstance(walk, Walk)
    assert name == "walk"
    assert walk.reward(robot())["forward"] == 4.0
    for given in (Still, f"{__name__}:Still"):
        task, name = as_task(given, {"weight": 3.0})
        assert reward_terms(task, name, robot()) == {"still": -6.0}
    task, name = as_task(Still(2.0))
    assert (reward_terms(task, name, robot()), name) == ({"still": -4.0}, "Still")
    for given in (climb, f"{__name__}:climb"):
        task, _ = as_task(given)
        assert reward_terms(task, "climb", robot()) == {"height": 0.5}


@pytest.mark.parametrize(
    ("task", "options", "error", "sentence"),
    [
        ("wlak", None, UnknownName, "No task matches 'wlak'. Did you mean 'walk'"),
        ("no_such_module:Task", None, TaskError, "is not found: No module named 'no_such_module'"),
        (f"{__name__}:Stil", None, UnknownName, "Did you mean 'Still'"),
        ("walk", {"speed": 1.0}, TaskError, "The task 'walk' cannot be made: .*'speed'"),
        (climb, {"speed": 1.0}, TaskError, "'climb' is not a class, so it takes no options"),
        (f"{__name__}:NOTHING", None, TaskError, "has no method `reward"),
        ("subprocess:Popen", {"args": ["false"]}, TaskError, "'subprocess:Popen' has no method"),
        (object(), None, TaskError, "The task 'object' has no method `reward"),
    ],
)
def test_a_task_that_cannot_be_made_is_refused(
    task: Any, options: Any, error: type[Exception], sentence: str
) -> None:
    """The message has the name of the task, and the nearest name if there is one."""
    with pytest.raises(error, match=sentence):
        as_task(task, options)


def test_a_class_of_a_module_has_a_name_that_json_can_hold() -> None:
    """Objects and local classes have no such name."""

    class Local(Still):
        pass

    still = Still()
    assert reference(Still) == f"{__name__}:Still"
    assert reference(climb) == f"{__name__}:climb"
    assert reference("walk") == "walk"
    assert reference(still) is still
    assert reference(Local) is Local


@pytest.mark.parametrize(
    ("terms", "sentence"),
    [
        (1.0, "returns float as reward: return a dict of terms"),
        ({"speed": math.nan}, "The reward term 'speed' of the task 'mine' is nan"),
        ({"speed": np.array([1.0, 2.0])}, "must be one finite number"),
        ({"speed": "fast"}, "is 'fast': it must be one finite number"),
        ({"speed": None}, "is None: it must be one finite number"),
    ],
)
def test_terms_are_finite_numbers(terms: Any, sentence: str) -> None:
    """Other values are refused with the name of the term and of the task."""
    task, _ = as_task(lambda _: terms)
    with pytest.raises(TaskError, match=sentence):
        reward_terms(task, "mine", robot())


def test_numbers_of_numpy_are_numbers() -> None:
    """Terms may be NumPy scalars, booleans and arrays without dimensions."""
    task, _ = as_task(lambda _: {"a": np.float32(0.5), "b": np.True_, "c": np.array(2), "d": True})
    terms = reward_terms(task, "mine", robot())
    assert terms == {"a": 0.5, "b": 1.0, "c": 2.0, "d": 1.0}
    assert {type(value) for value in terms.values()} == {float}


def test_a_task_may_end_the_episode() -> None:
    """A task ends no episode by default; `terminated` must return true or false."""
    task, _ = as_task(Still)
    assert not has_ended(task, "mine", robot())
    for answer in (True, np.True_):
        task.terminated = lambda _, answer=answer: answer  # type: ignore[attr-defined]
        assert has_ended(task, "mine", robot()) is True
    task.terminated = lambda _: 0.3  # type: ignore[attr-defined]
    with pytest.raises(TaskError, match=r"`terminated` of the task 'mine' returns 0\.3"):
        has_ended(task, "mine", robot())


def test_a_task_names_what_it_observes() -> None:
    """`observe` must be a list of names, or missing."""
    task, _ = as_task(Still)
    assert observed(task) == ["torso/z"]
    assert observed(as_task("walk")[0]) is None
    for wrong in ("torso/z", (), [3]):
        task.observe = wrong  # type: ignore[attr-defined]
        with pytest.raises(TaskError, match="`observe` must be a list of names or globs"):
            observed(task)


def test_walking_is_rewarded_for_speed_and_health() -> None:
    """A fallen robot loses the term `alive`, and ends the episode unless `terminate` is off."""
    walk = Walk(forward=2.0, alive=3.0, control=0.5, least_height=0.5, least_up=0.2)
    assert walk.reward(robot()) == {"forward": 4.0, "alive": 3.0, "control": -0.5}
    assert walk.measures[0] == FORWARD_SPEED
    assert not walk.terminated(robot())
    for fallen in (robot(place=np.array([0.0, 0.0, 0.2])), robot(up=0.1)):
        assert walk.reward(fallen)["alive"] == 0.0
        assert walk.terminated(fallen)
        assert not Walk(terminate=False).terminated(fallen)


def test_walking_needs_a_floor_and_a_free_trunk() -> None:
    """The errors name the edits that add them."""
    Walk().check(robot())
    with pytest.raises(TaskError, match=r"fixed to the world.*AddFreeJoint"):
        Walk().check(robot(can_travel=False))
    with pytest.raises(TaskError, match=r"would fall through the world.*AddFloor"):
        Walk().check(robot(standing_height=None))
