"""The env that sees a camera and sensors, and its courses and demonstrators."""

import subprocess
import sys
from collections.abc import Callable
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import msgspec
import numpy as np
import pytest

from scripts.lab_robots import lab_robots_json
from shapechanger.contract.env_ref import TaskDemonstrator
from shapechanger.contract.world import Pose
from shapechanger.errors import (
    ProfileError,
    RenderError,
    ShapechangerError,
    SpaceMismatch,
    UnknownName,
    WorldError,
)
from shapechanger.robot.profile.load import find_profile
from shapechanger.vehicles.courses.course import HELD_OUT, HOME, TRAINING
from shapechanger.vehicles.envs import RangesEnv, VehicleEnv, WaypointEnv, drive

_AHEAD = np.array([0.0, 0.6], np.float32)


def _car(**arguments: Any) -> VehicleEnv:
    return VehicleEnv("car", **{"image": False, **arguments})


def _played(env: VehicleEnv, seed: int, steps: int = 25) -> list[Any]:
    rng = np.random.default_rng(seed)
    found: list[Any] = [env.reset(seed=seed)[0].tolist()]
    for _ in range(steps):
        action = rng.uniform((-1.0, 0.0), (1.0, 1.0)).astype(np.float32)
        seen, reward, terminated, _, info = env.step(action)
        found.append((seen.tolist(), reward, info["pose"], info["progress"]))
        if terminated:
            break
    return found


@pytest.mark.parametrize("vehicle", HOME)
def test_each_vehicle_drives_in_its_default_world(vehicle: str) -> None:
    with closing(VehicleEnv(vehicle, image=False)) as env:
        assert env.action_layout.names == ("steering", "throttle")
        assert env.metadata["render_fps"] == 20
        _, info = env.reset(seed=1)
        assert info["progress"] == pytest.approx(0.0, abs=0.01)
        for _ in range(30):
            *_, info = env.step(_AHEAD)
        assert info["progress"] > 0.15
        assert (info["armed"], info["emergency"], info["course"]) == (True, False, env.world.seed)
        assert info["pose"] == (env.world.pose.x, env.world.pose.y, env.world.pose.heading)
        np.testing.assert_allclose(info["action_applied"], _AHEAD, atol=0.01)


@pytest.mark.parametrize("vehicle", HOME)
def test_episodes_are_independent(vehicle: str) -> None:
    """A reset also resets trailer, motor current and sensors."""
    with closing(VehicleEnv(vehicle, image=False)) as env:
        wanted = _played(env, 3)
        _played(env, 4)
        for _ in range(20):
            env.step(_AHEAD)  # The vehicle is still rolling at the reset.
        assert _played(env, 3) == wanted


@pytest.mark.parametrize("put_back", [False, True])
@pytest.mark.parametrize(
    ("made", "weight"),
    [
        (_car, -10.0),
        (partial(_car, reward={"collision": -3.0}), -3.0),
        (partial(RangesEnv, "car"), -3.0),
    ],
)
def test_a_collision_costs_and_ends_the_episode(
    made: Callable[..., Any], weight: float, put_back: bool
) -> None:
    """With `put_back` the episode continues, and the vehicle is at rest away from the wall."""
    with closing(made(put_back=put_back)) as env:
        env.reset(seed=1)
        found = 0
        for _ in range(300):
            _, reward, terminated, truncated, info = env.step(np.array([-0.6, 0.6], np.float32))
            hit, found = info["collisions"] - found, info["collisions"]
            assert (terminated, truncated) == (bool(hit) and not put_back, False)
            assert info["reward_terms"]["reward_collision"] == weight * hit
            assert reward == pytest.approx(sum(info["reward_terms"].values()))
            if terminated:
                break
            if hit:
                assert not env.world.touches
                assert env.world.inputs().speed == 0.0
        assert found > 1 if put_back else found == 1


def test_bang_steering_turns_half_into_full_steering() -> None:
    for steering, applied in (("bang", 1.0), ("proportional", 0.5)):
        with closing(_car(steering=steering)) as env:
            env.reset(seed=1)
            info = env.step(np.array([0.5, 0.0], np.float32))[4]
            assert info["action_applied"][0] == applied


def test_invalid_steps_are_refused() -> None:
    with closing(_car()) as env:
        with pytest.raises(gym.error.ResetNeeded, match="reset"):
            env.step(_AHEAD)
        env.reset(seed=1)
        for action in (np.zeros(3), np.array([np.nan, 0.0]), np.array([0.0, np.inf]), "left"):
            with pytest.raises((SpaceMismatch, ValueError)):
                env.step(action)  # pyright: ignore[reportArgumentType]  # The misuse.
        assert env.render() is None


def test_a_blocked_start_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with closing(_car()) as env:
        wall = env.world.course.walls[0]
        middle = (np.array(wall.start) + np.array(wall.end)) / 2.0
        pose = Pose(float(middle[0]), float(middle[1]), 0.0)
        monkeypatch.setattr(env.world, "place", lambda _: env.world.put(pose))
        with pytest.raises(WorldError, match="The car is stuck at start 3 of course 0"):
            env.reset(options={"course": 0, "start": 3})


@pytest.mark.parametrize(
    ("vehicle", "arguments", "kind", "sentence"),
    [
        ("tank", {"robot": "lab-car"}, ProfileError, "drives 'steering' and 'wheels'; a tank"),
        ("car", {"robot": "cat"}, ProfileError, "the robot has no camera, and this task needs"),
        ("car", {"lenses": "nihgt"}, UnknownName, "No lens matches 'nihgt'. Did you mean"),
        ("car", {"steering": "bangg"}, UnknownName, "No steering matches 'bangg'. Did you mean"),
        ("car", {"reward": {"speeed": 1.0}}, UnknownName, "No weight of the reward matches"),
        ("car", {"courses": "hold-out"}, UnknownName, "No kind of courses matches 'hold-out'"),
        ("car", {"courses": ()}, WorldError, "There are no courses to draw from"),
        ("car", {"courses": None}, WorldError, "The seed of a course must be .*, got None"),
        ("car", {"render_mode": "human"}, UnknownName, "No render mode matches 'human'"),
        ("car", {"size": (0, 0)}, SpaceMismatch, r"each 1 to 1920 pixels, got \(0, 0\)"),
        ("car", {"options": {"curse": 1}}, UnknownName, "'curse'. Did you mean 'course'"),
        ("car", {"options": {"course": "a"}}, WorldError, "course must be a whole .*, got 'a'"),
        ("car", {"options": {"start": -1}}, WorldError, "start must be a whole .* 0, got -1"),
    ],
)
def test_invalid_arguments_and_options_are_refused(
    vehicle: str, arguments: dict[str, Any], kind: type[ShapechangerError], sentence: str
) -> None:
    options = arguments.get("options")  # Of a reset.
    env = VehicleEnv(vehicle, image=False) if options else None
    with pytest.raises(kind, match=sentence):
        env.reset(options=options) if env else VehicleEnv(vehicle, image=False, **arguments)


@pytest.mark.gl
@pytest.mark.usefixtures("gl")
def test_render_shows_the_cameras_picture() -> None:
    with closing(_car(size=(48, 32), render_mode="rgb_array")) as env:
        with pytest.raises(RenderError, match="before render"):
            env.render()
        env.reset(seed=1)
        picture = env.render()
        assert picture is not None
        assert picture.shape == (32, 48, 3)
        assert picture.std() > 5.0


def test_the_copied_numbers_equal_the_profiles() -> None:
    """After a change of a profile, `python -m scripts.lab_robots` copies its numbers."""
    file = Path(drive.__file__).with_name("lab_robots.json")
    assert file.read_text("utf-8") == lab_robots_json()


def test_a_shipped_profile_and_its_copy_give_the_same_robot(tmp_path: Path) -> None:
    """The modules of real robots read a copied profile, and find the same numbers."""
    copy = tmp_path / "mine.toml"
    copy.write_bytes(find_profile("lab-car").read_bytes())
    mine, lab = (drive.simulated_robot("car", robot) for robot in (copy, None))
    assert mine == msgspec.structs.replace(lab, path=str(copy))


@pytest.mark.parametrize(("env", "most"), [("CarRanges", 55), ("Car", 55)])
def test_a_simulation_loads_no_module_of_the_robot(env: str, most: int) -> None:
    """Making an env loads few modules of the package, and none for real robots."""
    script = f"import gymnasium, shapechanger, sys; gymnasium.make('shapechanger/{env}-v1')"
    command = [sys.executable, "-c", f"{script}; print(*sys.modules)"]
    loaded = subprocess.check_output(command, text=True).split()
    ours = [name for name in loaded if name.partition(".")[0] == "shapechanger"]
    assert len(ours) <= most
    assert not [name for name in ours if name.startswith("shapechanger.robot")]


@pytest.mark.parametrize(
    ("courses", "held_out", "seeds"),
    [
        ("training", False, TRAINING),
        ("held-out", False, HELD_OUT),
        ("training", True, HELD_OUT),
        ((3, 4), True, HELD_OUT),
        ((7, np.int64(9)), False, {7, 9}),
    ],
)
def test_courses_are_drawn_from_their_seeds(courses: Any, held_out: bool, seeds: Any) -> None:
    with closing(RangesEnv("car", courses=courses)) as env:
        if held_out:
            env.hold_out()
        drawn = [env.reset(seed=seed)[1]["course"] for seed in (1, *[None] * 5)]
    assert all(course in seeds for course in drawn)
    assert len(set(drawn)) > 1
    assert not set(TRAINING) & set(HELD_OUT)


def test_options_do_not_change_other_draws() -> None:
    with closing(RangesEnv("car", randomise=True)) as env:

        def drawn(**options: int) -> tuple[int, Any, Any]:
            info = env.reset(seed=5, options=options)[1]
            return info["course"], env.world.look, info["pose"]

        course, look, pose = drawn()
        assert drawn(course=course) == (course, look, pose)
        assert drawn(start=4)[:2] == (course, look)
        assert drawn(start=4)[2] == drawn(start=4)[2] != pose
        other = drawn(course=course + 1)
        assert other[:2] == (course + 1, look)
        env.reset()
        assert env.world.look != look


@pytest.mark.parametrize("vehicle", HOME)
def test_a_disturbed_demonstrator_makes_progress(vehicle: str) -> None:
    """The demonstrator makes mistakes and drives without collisions."""
    with closing(VehicleEnv(vehicle, image=False)) as env:
        driver: TaskDemonstrator = env.demonstrator(3)
        env.reset(seed=2)
        driver.begin()
        mistakes = 0
        for _ in range(100):
            meant, done = driver.act()
            assert env.action_space.contains(meant)
            assert env.action_space.contains(done)
            mistakes += not np.array_equal(meant, done)
            _, _, terminated, _, info = env.step(done)
            assert not terminated
        assert info["progress"] > 1.0
        assert mistakes > 0


def test_another_control_rate_is_refused(tmp_path: Path) -> None:
    """Experts need a control period of 1/20 s."""
    slow = tmp_path / "slow.toml"
    text = find_profile("lab-car").read_text()
    slow.write_text(text.replace("control_hz = 20", "control_hz = 10"))
    with (
        closing(VehicleEnv("car", robot=slow, image=False)) as env,
        closing(WaypointEnv("car", robot=slow)) as waypoints,
    ):
        for refused in (
            lambda: env.demonstrator(1),
            env.expert,
            lambda: env.taught_by(lambda seen: seen[:, :2], 1),
            lambda: waypoints.demonstrator(1),
        ):
            with pytest.raises(ProfileError, match=r"control_hz = 10.*20 actions a second"):
                refused()
