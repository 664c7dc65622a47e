"""The remote env against a fake robot on a real socket."""

import contextlib
import dataclasses
import gc
import itertools
import re
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from shapechanger.contract import testing
from shapechanger.contract.env_ref import EnvRef, layouts_of
from shapechanger.contract.testing import MakeEnv
from shapechanger.errors import LinkError, RenderError, RobotRefused, SpaceMismatch, UnknownName
from shapechanger.layout import Element, Feature
from shapechanger.robot.client.env import RemoteVehicleEnv
from shapechanger.robot.client.known_robots import remember
from shapechanger.robot.link import messages as m
from shapechanger.vehicles.remote.discrete_driving import FOUR_WAYS, DiscreteDriving
from tests.robot.client.robot import FULL_SPEED, STATE, THROTTLE, WALL, Robot, eventually

pytestmark = pytest.mark.realtime

Run = Callable[..., Robot]

ID = "shapechanger/RemoteVehicle-v1"
AHEAD = np.array([0.0, 1.0], np.float32)
TENDONS = tuple(
    Feature(name, "1", 0.0, 1.0, Element("tendon", name)) for name in ("FDP", "FDS", "EDC")
)

Made = Callable[..., Any]

REST = np.zeros(2, np.float32)


@pytest.fixture
def made() -> Iterator[Made]:
    with contextlib.ExitStack() as stack:

        def make(robot: Robot, **how: Any) -> Any:
            env = gym.make(ID, **{"pace": "lockstep"} | robot.arguments | how)
            stack.callback(env.close)
            return env

        yield make


@pytest.fixture
def started(made: Made) -> Made:
    def start(robot: Robot, **how: Any) -> Any:
        env = made(robot, **how)
        env.reset(seed=0)
        return env

    return start


PROMISES = (
    testing.passes_gymnasiums_checker,
    testing.is_deterministic,
    testing.shares_no_memory,
    testing.names_every_number,
    testing.reward_is_the_sum_of_its_terms,
    testing.pickles,
)


@pytest.mark.parametrize(
    ("promise", "camera", "image"),
    [
        (promise, camera, image)
        for camera, image in ((True, None), (True, False), (False, None))
        for promise in PROMISES
        if image is False or not camera or promise is not testing.names_every_number
    ],
)
def test_an_env_passes_the_checks(
    run: Run, made: Made, promise: Callable[[MakeEnv], None], camera: bool, image: bool | None
) -> None:
    robot = run(home_at_take=True, image_size=(160, 120) if camera else None)
    promise(partial(made, robot, image=image))


def test_layouts_name_images_and_states(run: Run, made: Made) -> None:
    env = made(run(), state=True, size=(40, 30), render_mode="rgb_array")
    observation, action = layouts_of(env)
    assert observation.names == ("camera/image", *(f.name for f in STATE))
    assert observation["camera/image"].shape == (30, 40, 3)
    assert action.names == ("steering", "throttle")
    seen, _ = env.reset(seed=0)
    assert env.observation_space.contains(seen)
    assert gym.spaces.flatten(env.observation_space, seen).shape == (observation.size,)
    assert env.render().shape == (120, 160, 3)


def test_the_reward_is_metres_forward(run: Run, started: Made) -> None:
    robot = run(reward={"velocity": 2.0})
    env = started(robot, reward={"stall": -5.0})
    way = FULL_SPEED / robot.control_hz  # m in a step.
    _, forth, *_, info = env.step(AHEAD)
    assert forth == info["reward_velocity"] == pytest.approx(2.0 * way)
    assert env.step(-AHEAD)[1] == pytest.approx(-2.0 * way)
    encoder = dict.fromkeys(("speed", "stall"), "encoder")
    assert info["reward_sources"] == encoder | {"collision": "bumper"}
    answers = [command.answers for command in robot.received(m.Command)]
    assert answers == sorted(set(answers))  # Each command answers a newer observation.


def test_a_collision_costs_once_and_ends_the_episode(run: Run, started: Made) -> None:
    robot = run()
    env = started(robot, on_reset=lambda seed: robot.stand_at(0.0))
    ends = []
    for _ in range(int(WALL / FULL_SPEED * robot.control_hz) + 3):
        _, _, terminated, truncated, info = env.step(AHEAD)
        ends.append((terminated, truncated, info["reward_collision"]))
        if terminated:
            break
    assert ends[-1] == (True, False, -10.0)
    assert not any(terminated or truncated for terminated, truncated, _ in ends[:-1])
    *_, terminated, _, info = env.step(AHEAD)
    assert (terminated, info["reward_collision"]) == (False, 0.0)
    env.reset(seed=0)
    assert env.step(AHEAD)[2] is False


def test_a_bump_between_two_observations_counts_once(run: Run, started: Made) -> None:
    robot = run(reward={"collision_ends_episode": 0.0})
    env = started(robot)
    env.step(REST)
    robot.send(m.Event(name="bump", text="It bumped into something.", at_ns=0))
    *_, info = env.step(REST)
    assert info["reward_collision"] == -10.0
    assert info["events"] == ("It bumped into something.",)
    robot.stand_at(WALL)
    assert env.step(REST)[4]["reward_collision"] == 0.0


def test_an_unmeasured_quantity_is_absent(run: Run, made: Made) -> None:
    robot = run(absent=("speed", "stall"))
    env = made(robot, state=True)
    seen, _ = env.reset(seed=0)
    *_, info = env.step(AHEAD)
    assert info["reward_sources"] == {"speed": "absent", "collision": "bumper", "stall": "absent"}
    assert set(info["reward_terms"]) == {"reward_collision"}
    assert info["absent"] == ("speed", "stall")
    assert np.isfinite(seen["state"]).all()


@pytest.mark.parametrize("clock", ["real", "twin"])
def test_the_measurable_latencies_are_reported(run: Run, started: Made, clock: str) -> None:
    robot = run(clock=clock)
    env = started(robot)
    latency = env.step(AHEAD)[-1]["latency"]
    known = {"capture_to_send", "observation_age_at_action", "command_to_pin"}
    # If the robot's time is a twin's, the round trip in real time is unknown.
    assert set(latency) == known | ({"round_trip"} if clock == "real" else set())
    assert 0.0 < latency.get("round_trip", 1.0) < 5.0
    robot.refusal = "It is too old."
    *_, info = env.step(AHEAD)
    assert set(info["latency"]) == {"capture_to_send"}
    assert info["refused"] == "It is too old."
    assert info["action_applied"].tolist() == [0.0, 0.0]


@pytest.mark.parametrize("how", ["frozen", "broken"])
def test_a_repeated_image_is_reported(run: Run, how: str, started: Made) -> None:
    robot = run()
    env = started(robot)
    before, *_, info = env.step(AHEAD)
    assert not info["frame_repeated"]
    if how == "frozen":
        robot.frozen = True
    else:
        robot.jpeg = b"\xff\xd8 no picture"
    after, *_, info = env.step(AHEAD)
    assert info["frame_repeated"]
    assert np.array_equal(before, after)
    assert how == "broken" or info["frame_age"] > 1.0


def test_an_episode_needs_a_new_frame(run: Run, made: Made) -> None:
    env = made(run(frozen=True), reset_timeout_s=0.2)
    with pytest.raises(LinkError, match="Does its camera still work"):
        env.reset(seed=0)


def test_an_action_is_clipped_or_an_error(run: Run) -> None:
    robot = run()
    with RemoteVehicleEnv(pace="lockstep", **robot.arguments) as env:
        env.reset(seed=0)
        for action in ([0.0], [0.0, np.nan], [0.0, np.inf], [[0.0, 0.0]]):
            with pytest.raises(SpaceMismatch, match=r"2 finite numbers \(steering, throttle\)"):
                env.step(np.array(action))
        assert not robot.received(m.Command)
        *_, info = env.step(np.array([-3.0, 2.0], np.float32))
        assert info["action_applied"].tolist() == [-1.0, 1.0]


@pytest.mark.parametrize(
    ("change", "because", "interventions"),
    [
        ({"emergency": True, "stop_reason": "It was pressed."}, "Emergency stop: It", False),
        ({"emergency": True, "stop_reason": "It was pressed."}, "Emergency stop: It", True),
        ({"armed": False}, "The robot was disarmed.", False),
        ({"armed": False}, "The robot was disarmed.", True),
        ({"held_by": "Grace"}, "Grace has control of the robot now.", False),
    ],
)
def test_a_person_truncates_the_episode(
    run: Run, change: dict[str, Any], because: str, interventions: bool, started: Made
) -> None:
    robot = run()
    env = started(robot, interventions=interventions)
    for name, value in change.items():
        setattr(robot, name, value)
    *_, terminated, truncated, info = env.step(AHEAD)
    assert (terminated, truncated) == (False, True)
    assert info["truncated_because"].startswith(because)


def test_a_lost_link_truncates_and_the_next_reset_connects_again(
    credentials: Path, made: Made
) -> None:
    robot = Robot()
    with robot.running(credentials):
        env = made(robot, reset_timeout_s=20.0)
        env.reset(seed=0)
        last, *_ = env.step(AHEAD)
        port = robot.port
    seen, reward, terminated, truncated, info = env.step(AHEAD)
    assert (reward, terminated, truncated) == (0.0, False, True)
    assert "lost" in info["truncated_because"]
    assert np.array_equal(seen, last)
    assert not np.may_share_memory(seen, last)
    assert info["frame_repeated"]
    with pytest.raises(gym.error.ResetNeeded):
        env.step(AHEAD)
    with robot.running(credentials, port):
        env.reset(seed=0)
        assert env.step(AHEAD)[3] is False
        env.close()


def test_reset_waits_for_the_operator(run: Run, made: Made) -> None:
    robot = run(arming="person")
    sentences: list[str] = []

    def on_waiting(sentence: str) -> None:
        sentences.append(sentence)
        robot.armed = True

    env = made(robot, on_waiting=on_waiting, reset_timeout_s=20.0)
    _, info = env.reset(seed=0)
    assert info["armed"]
    assert len(sentences) == 1
    assert sentences[0].startswith("tin waits for its operator: put it at the start and arm it: ")
    assert "`shapechanger robot drive tin` in another terminal, and there P" in sentences[0]
    env.step(AHEAD)
    env.reset(seed=0)
    assert robot.received(m.Disarm)  # The operator may pick the robot up.
    assert len(sentences) == 2


def test_a_reset_disarms_the_robot_and_gets_the_seed(run: Run, started: Made) -> None:
    robot = run()
    calls: list[tuple[int | None, int]] = []
    env = started(robot, on_reset=lambda seed: calls.append((seed, len(robot.received(m.Disarm)))))
    env.step(AHEAD)
    env.reset()
    assert calls == [(0, 0), (None, 1)]


def test_reset_waits_for_another_driver(run: Run, made: Made, started: Made) -> None:
    robot = run(held_by="Grace")
    sentences: list[str] = []

    def on_waiting(sentence: str) -> None:
        sentences.append(sentence)
        robot.held_by = ""

    started(robot, on_waiting=on_waiting, reset_timeout_s=20.0)
    assert sentences == ["Grace has control."]
    robot.held_by = "Grace"
    impatient = made(robot, reset_timeout_s=0.1)
    with pytest.raises(RobotRefused, match="Grace has control"):
        impatient.reset(seed=0)


def test_the_reset_routine_of_the_profile_runs(run: Run, made: Made, started: Made) -> None:
    robot = run(reset=(((0.0, -0.5), 0.5), ((1.0, 0.0), 0.2)))
    started(robot, on_reset="routine")
    values = [command.values for command in robot.received(m.Command)]
    assert values.count((0.0, -0.5)) == 10
    assert values.count((1.0, 0.0)) == 4
    without = run()
    with pytest.raises(RobotRefused, match=r"\[\[reset\]\]"):
        made(without, on_reset="routine").reset(seed=0)
    assert not without.received(m.Arm)


@pytest.mark.parametrize("how", ["closed", "dropped"])
def test_an_ended_env_gives_control_back(run: Run, how: str) -> None:
    robot = run()
    env = gym.make(ID, pace="lockstep", **robot.arguments)
    env.reset(seed=0)
    if how == "closed":
        env.close()
        env.close()
    del env
    gc.collect()
    eventually(lambda: len(robot.received(m.Release)) == 1)


@pytest.mark.parametrize(("pace", "missed"), [("realtime", [1, 1, 2, 2]), ("lockstep", [0] * 4)])
def test_late_steps_are_counted(
    run: Run, monkeypatch: pytest.MonkeyPatch, pace: str, missed: list[int], made: Made
) -> None:
    late = itertools.cycle((True, False))
    monkeypatch.setattr("shapechanger.robot.client.env.next_tick", lambda *_: (0.0, next(late)))
    env = made(run(control_hz=50.0, clock="real"), pace=pace)
    for _ in range(2):
        _, info = env.reset(seed=0)
        assert info["deadline_missed"] == 0
        assert [env.step(REST)[-1]["deadline_missed"] for _ in range(4)] == missed


def test_a_twins_clock_is_driven_in_lockstep_only(run: Run) -> None:
    with pytest.raises(RobotRefused, match="pass pace='lockstep'"):
        RemoteVehicleEnv(**run(clock="twin").arguments)


def test_a_finger_is_driven_by_the_same_class(run: Run, made: Made) -> None:
    robot = run(
        actions=TENDONS,
        state=tuple(Feature(f"{f.name}/applied", "1", 0.0, 1.0, f.element) for f in TENDONS),
        image_size=None,
    )
    env = made(robot, render_mode="rgb_array")
    assert env.action_space.low.tolist() == [0.0, 0.0, 0.0]
    assert env.observation_space.shape == (3,)
    env.reset(seed=0)
    _, reward, *_, info = env.step(np.array([0.5, 0.0, 1.0], np.float32))
    assert info["action_applied"].tolist() == [0.5, 0.0, 1.0]
    assert (reward, info["reward_terms"]) == (0.0, {})
    assert set(info["reward_sources"].values()) == {"absent"}
    with pytest.raises(RobotRefused, match="has no camera"):
        made(robot, image=True)
    with pytest.raises(RenderError, match="Does it have a camera"):
        env.unwrapped.render()


def test_a_known_robot_is_made_by_its_name(run: Run) -> None:
    remember(run().known)
    with EnvRef(ID, {"robot": "tin", "pace": "lockstep"}).make() as env:
        env.reset(seed=0)
    with pytest.raises(UnknownName, match="Did you mean 'tin'"):
        gym.make(ID, robot="tim")


def test_four_keys_drive_as_in_the_original_release(run: Run, made: Made) -> None:
    env = DiscreteDriving(made(run()), throttle=0.6, steering=0.4)
    env.reset(seed=0)
    applied = dict(forward=[0.0, 0.6], backward=[0.0, -0.6], right=[0.4, 0.0], left=[-0.4, 0.0])
    for key, way in enumerate(FOUR_WAYS):
        info = env.step(np.int64(key))[4]
        assert info["action_applied"].tolist() == pytest.approx(applied[way])
    for key in (4, -1, 1.5, "forward", None):
        with pytest.raises(SpaceMismatch, match=r"0 \(forward\), 1 \(backward\)"):
            env.action(key)
    with pytest.raises(SpaceMismatch, match="steering, throttle"):
        DiscreteDriving(made(run(actions=(THROTTLE,))))


PAGE = Path(__file__).parents[3] / "docs" / "remote.md"


def test_the_examples_drive_a_robot(run: Run, capsys: pytest.CaptureFixture[str]) -> None:
    robot = run(control_hz=100.0, clock="real")
    remember(dataclasses.replace(robot.known, name="new-bright"))
    names: dict[str, Any] = {"__name__": "__main__"}
    blocks = re.findall(r"```(?:py|python)\n(.*?)```", PAGE.read_text(), re.DOTALL)
    assert len(blocks) == 4
    for block in blocks:
        exec(compile(block, str(PAGE), "exec"), names)
        if "env" in names:
            names["env"].close()
    assert capsys.readouterr().out.startswith("(0.0, 0.3)")
