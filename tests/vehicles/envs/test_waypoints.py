"""The waypoint env, steering responses, and certificates of shifts between vehicles."""

import dataclasses
import itertools
import math
import re
from contextlib import closing
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from numpy.typing import NDArray

from shapechanger.contract.world import STANDING_MPS
from shapechanger.envs.catalogue import WAYPOINT_ENVS
from shapechanger.errors import EmptyShift, MorphologyError, ProfileError, SpaceMismatch, StudyError
from shapechanger.robot.profile.load import find_profile
from shapechanger.vehicles.envs import RangesEnv, VehicleEnv, WaypointEnv
from shapechanger.vehicles.waypoints import (
    AHEAD_M,
    LEAST_THROTTLE,
    SteeringResponse,
    _is_steady,
    command,
    fit_response,
    measure_response,
    waypoints_of,
)

_BODIES = {"wheels": SteeringResponse(2.0, 0.0), "tracks": SteeringResponse(0.8, 3.1)}
_TRACKS = SteeringResponse(0.1, 0.6)
_COURSE = {"course": 2, "start": 2}
_BLIND: dict[str, Any] = {"image": False, "put_back": True}


@pytest.mark.parametrize("response", [*_BODIES.values(), _TRACKS])
@pytest.mark.parametrize("on_the_spot", [True, False])
def test_steering_follows_from_the_bearing(response: SteeringResponse, on_the_spot: bool) -> None:
    """Tracks have the sum and difference of throttle and steering, which must not saturate."""
    for bearing, share, speed in itertools.product(
        (-4.0, -0.3, 0.0, 0.2, 3.0), (-3.0, -0.6, 0.9, 2.0), (0.1, 1.2)
    ):
        action = np.array((bearing, share))
        steering, throttle = made = command(action, response, speed, on_the_spot=on_the_spot)
        assert made.dtype == np.float32
        turn = 2.0 * math.sin(np.clip(bearing, -1.0, 1.0)) / AHEAD_M  # rad/m.
        fast = max(speed, 0.3)
        full = response.per_metre * fast + response.per_second
        assert steering == pytest.approx(np.clip(turn * fast / full, -1.0, 1.0))
        asked = np.clip(0.5 * (share + 1.0), 0.25, 1.0)
        room = max(1.0 - abs(steering), 0.25) if on_the_spot else 1.0
        assert throttle == pytest.approx(min(asked, room))


@pytest.mark.parametrize("action", [(0.1,), (0.1, 0.2, 0.3), (np.nan, 0.0), (0.0, np.inf)])
def test_a_waypoint_is_two_finite_numbers(action: tuple[float, ...]) -> None:
    with pytest.raises(SpaceMismatch, match="must be two finite numbers, bearing and speed, got"):
        command(np.array(action), _TRACKS, 1.0, on_the_spot=False)


@pytest.mark.parametrize("body", _BODIES)
@pytest.mark.parametrize("speed", [0.5, 1.0, 2.0])
def test_commands_lead_back_to_their_waypoints(body: str, speed: float) -> None:
    """Within the range of steering and throttle, `waypoints_of` is the inverse of `command`."""
    response = _BODIES[body]
    bearings, shares = np.meshgrid(np.linspace(-0.7, 0.7, 15), np.linspace(-0.5, -0.1, 5))
    wanted = np.stack((bearings.ravel(), shares.ravel()), axis=1).astype(np.float32)
    commands = np.array([command(one, response, speed, on_the_spot=False) for one in wanted])
    speeds = np.full(len(wanted), speed)
    found = waypoints_of(commands, response, speeds)
    assert found.usable.all()
    within = ~found.at_limit
    assert within.mean() > 0.7
    np.testing.assert_allclose(found.actions[within], wanted[within], atol=1e-5)
    # At the limit, the waypoint has the same command, but not always the same bearing.
    again = [command(one, response, speed, on_the_spot=False) for one in found.actions]
    np.testing.assert_allclose(again, commands, atol=1e-5)


def test_commands_that_do_not_point_ahead_are_not_usable() -> None:
    """Braking and starting are usable; standing, driving backward and unknown speeds are not."""
    commands = np.array(
        [
            (0.5, 0.0),  # Stands, with turned wheels.
            (0.5, 0.1),  # Stands, with too little throttle.
            (0.0, -0.6),  # Starts backward.
            (0.3, -0.6),  # Drives backward.
            (0.0, 0.5),  # Unknown speed.
            (np.nan, 0.5),
            (0.3, 0.5),  # Starts.
            (0.3, -0.6),  # Brakes.
        ]
    )
    speed = np.array([0.0, 0.0, 0.0, -0.5, np.nan, 1.0, 0.0, 1.5])
    found = waypoints_of(commands, _BODIES["wheels"], speed)
    assert found.usable.tolist() == [False] * 6 + [True, True]
    np.testing.assert_allclose(found.actions[6:, 1], [0.0, -1.0])
    assert found.actions.dtype == np.float32
    # Commands are clipped, and the bearing ends at the widest, where the circle is narrower.
    sharp = waypoints_of(
        np.array([(9.0, 9.0), (-9.0, -9.0)]), SteeringResponse(3.0, 0.0), np.ones(2)
    )
    np.testing.assert_allclose(sharp.actions, [(1.0, 1.0), (-1.0, -1.0)])
    weak = waypoints_of(np.array([(9.0, 0.5)]), _BODIES["wheels"], np.array([1.0]))
    assert weak.actions[0, 0] == pytest.approx(math.asin(0.8))
    edges = np.array([(0.0, 0.0), (0.0, LEAST_THROTTLE), (0.5, 0.0)])
    still = waypoints_of(edges, _BODIES["tracks"], np.array([STANDING_MPS, 0.0, 0.0]))
    assert still.usable.all()
    braked = command(found.actions[7], _BODIES["wheels"], 1.5, on_the_spot=False)
    assert braked[1] == pytest.approx(0.25)  # A waypoint cannot brake harder.


@pytest.mark.parametrize("body", _BODIES)
def test_the_response_is_fitted_to_a_drive(body: str) -> None:
    """Steps less than 0.1 s after a change of the steering, and NaN, are ignored."""
    rng = np.random.default_rng(0)
    steering, speed = np.repeat(rng.uniform((-0.6, 0.5), (0.6, 2.0), (120, 2)), 3, axis=0).T
    turn = steering * (_BODIES[body].per_metre * speed + _BODIES[body].per_second)
    yaw_rate = -turn + rng.normal(0.0, 0.02, len(turn))
    changes = np.abs(steering - np.roll(steering, 1)) > 0.1
    lags = changes | np.roll(changes, 1)  # 0 and 0.05 s after a change.
    yaw_rate[lags] += 3.0 * rng.normal(size=lags.sum())
    yaw_rate[10] = np.nan
    found = fit_response(steering, speed, yaw_rate, np.arange(360) / 20.0)
    assert found.per_metre == pytest.approx(_BODIES[body].per_metre, abs=0.05)
    assert found.per_second == pytest.approx(_BODIES[body].per_second, abs=0.05)


def test_a_drive_without_a_clear_response_is_refused() -> None:
    """Straight driving, turning against the steering, and NaN are refused."""
    rng = np.random.default_rng(0)
    steering, speed = np.repeat(rng.uniform(-0.6, 0.6, 40), 5), np.ones(200)
    times_s = np.arange(200) / 20.0
    for yaw_rate in (rng.normal(0.0, 0.3, 200), 2.0 * steering, np.full(200, np.nan)):
        with pytest.raises(StudyError, match=r"steering explains .* drive curves to both sides"):
            fit_response(steering, speed, yaw_rate, times_s)
    with pytest.raises(StudyError, match="drive curves to both sides"):
        fit_response(np.zeros(200), speed, rng.normal(0.0, 0.3, 200), times_s)


def test_the_share_of_the_turning_that_steering_explains() -> None:
    """The deviation from the turn is orthogonal to it: 1.5 parts of squares, of 2.5 in all."""
    steering = np.repeat(np.tile((0.5, -0.5), 20), 6)
    deviation = math.sqrt(1.5) * np.tile((1.0, -1.0), 120)
    with pytest.raises(StudyError, match="steering explains 40% of how the vehicle turns"):
        fit_response(steering, np.ones(240), deviation - 2.0 * steering, np.arange(240) / 20.0)


@pytest.mark.parametrize(
    ("times_s", "steady"),
    [
        ([0.0], [0]),
        ([0.0, 0.05, 0.1, 0.15, 0.35, 0.4, 0.45], [0, 0, 1, 1, 0, 0, 1]),  # A gap.
        ([0.0, 0.05, 0.1, 0.21, 0.26], [0, 0, 1, 1, 1]),  # One frame was lost.
        ([0.0, 0.05, 0.1, 0.1, 0.15, 0.2], [0, 0, 1, 0, 0, 1]),  # Another episode.
        ([0.0, 0.25, 0.5, 0.75, 1.125, 1.625], [0, 1, 1, 1, 1, 0]),
        (np.arange(12) / 100.0, [0] * 10 + [1, 1]),
    ],
)
def test_steps_are_steady_from_the_lag_on(times_s: list[float], steady: list[int]) -> None:
    found = _is_steady(np.zeros(len(times_s)), np.asarray(times_s))
    assert found.tolist() == list(map(bool, steady))


_TABLE = r"^\[sensor\.{}\]\n(?:[^\[\n].*\n|\n)*"


@pytest.mark.parametrize(
    ("removed", "message"),
    [
        ("^pitch_deg.*", r"\[camera\] does not state pitch_deg and fovy_deg"),
        (_TABLE.format("wheel"), "car.toml has no sensor of speed, which waypoints"),
        (_TABLE.format("(?:wheel|motion)"), "no sensor of speed and yaw_rate, which waypoints"),
    ],
    ids=["pitch", "speed", "motion"],
)
def test_sensed_waypoints_need_geometry_and_sensors(
    tmp_path: Path, removed: str, message: str
) -> None:
    path = tmp_path / "car.toml"
    text = find_profile("lab-car").read_text(encoding="utf-8")
    path.write_text(re.sub(removed, "", text, flags=re.MULTILINE), encoding="utf-8")
    with pytest.raises(ProfileError, match=message):
        WaypointEnv("car", robot=path, sensed=True)


class _Turning(gym.Env[Any, Any]):
    """A vehicle that turns exactly as `_TRACKS`, but not in the first steps after a new command."""

    def __init__(self) -> None:
        self.metadata = {"render_fps": 20.0}
        self.commands: list[NDArray[np.float32]] = []
        self.resets: list[tuple[int | None, int]] = []

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, Any]:
        self.resets.append((seed, len(self.commands)))
        return None, {}

    def step(self, action: NDArray[np.float32]) -> tuple[Any, float, bool, bool, Any]:
        self.commands.append(action)
        speed, age = len(self.commands) % 7 / 4.0, (len(self.commands) - 1 - self.resets[-1][1]) % 6
        turn = float(action[0]) * (_TRACKS.per_metre * speed + _TRACKS.per_second)
        numbers = np.array([9.0, speed, 9.0, -turn if age >= 3 else 9.0])
        seen = numbers if len(self.commands) % 2 else {"state": numbers}
        return seen, 0.0, len(self.commands) == 14, len(self.commands) == 31, {}


def test_the_response_is_measured_in_the_second_half_of_each_command() -> None:
    env, again = _Turning(), _Turning()
    assert dataclasses.astuple(measure_response(env, 1, 3)) == pytest.approx((0.1, 0.6))
    measure_response(again, 1, 3)
    np.testing.assert_array_equal(again.commands, env.commands)
    assert env.resets == [(0, 0), (None, 14), (None, 31)]
    starts = [0, 6, 12, 14, 20, 26, *range(31, 100, 6)]
    assert [
        i for i, now in enumerate(env.commands) if i == 0 or (now != env.commands[i - 1]).any()
    ] == starts
    steering, throttle = np.array([env.commands[i] for i in starts]).T
    assert (len(env.commands), env.commands[0].dtype) == (100, np.float32)
    assert -0.5 <= steering.min() < -0.3 < 0.3 < steering.max() <= 0.5
    assert 0.4 <= throttle.min() < 0.5 < 0.7 < throttle.max() <= 0.8


def test_the_measured_response_matches_the_geometry() -> None:
    with closing(RangesEnv("car", put_back=True)) as env:
        places = env.observation_layout.slices
        found = measure_response(env, places["speed"].start, places["yaw_rate"].start)
    # The tangent of the full lock divided by the wheelbase, 1/m; the tyres slip a little.
    drawn = math.tan(math.radians(28.0)) / 0.26
    assert found.per_metre + found.per_second == pytest.approx(drawn, rel=0.15)


@pytest.mark.gl
@pytest.mark.usefixtures("gl")
@pytest.mark.parametrize(
    ("vehicle", "sensed"),
    [("car", True), *((entry.kwargs["vehicle"], False) for entry in WAYPOINT_ENVS.values())],
)
def test_following_the_experts_waypoints_has_no_collisions(vehicle: str, sensed: bool) -> None:
    with closing(WaypointEnv(vehicle, sensed=sensed, put_back=True)) as env:
        seen, _ = env.reset(options=_COURSE)
        assert env.observation_space.contains(seen)
        guide = env.demonstrator(0)
        for _ in range(150):
            waypoint, _ = guide.act()
            assert env.action_space.contains(waypoint)
            *_, info = env.step(waypoint)
        assert info["collisions"] == 0
        assert info["progress"] > 2.0
        assert env.world.course.world == ("flooded-corridor" if vehicle == "boat" else "corridor")


def test_another_vehicle_is_a_shift() -> None:
    with closing(VehicleEnv("car", **_BLIND)) as car, closing(VehicleEnv("tank", **_BLIND)) as tank:
        text = VehicleEnv.certify_shift(car, tank)
    for part in (
        "length: 0.4 m -> 0.32 m",
        "driven by: steering and wheels -> left track and right track",
        "turns on the spot",
        "camera's angle below the horizon: 0 degrees -> 3 degrees",
        "straight ahead at a throttle of 0.5 for 20 steps:",
    ):
        assert part in text
    assert "place" not in text  # Both have the corridor as their default world.


@pytest.mark.gl
def test_a_shift_shows_the_map_of_waypoints_to_each_body() -> None:
    with closing(WaypointEnv("car")) as car, closing(WaypointEnv("tank")) as tank:
        text = WaypointEnv.certify_shift(car, tank)
        maps = [
            f"{body.response.per_metre:.2f} rad/m and {body.response.per_second:.2f} rad/s"
            for body in (car, tank)
        ]
    assert f"the map of waypoints to this body: {maps[0]} -> {maps[1]}" in text
    assert maps[0] != maps[1]
    assert "straight ahead at a speed of 0.5" in text


@pytest.mark.gl
def test_shifts_of_one_vehicle() -> None:
    """An equal env is refused; a lens does not change the motion, and a wrapper no property."""
    size = (40, 30)
    with (
        closing(VehicleEnv("car", size=size, put_back=True)) as car,
        closing(VehicleEnv("car", size=size, put_back=True, lenses=("night",))) as dark,
        closing(VehicleEnv("car", size=size, put_back=True)) as same,
        closing(gym.wrappers.TransformAction(same, lambda action: 0.5 * action, None)) as lame,
        closing(gym.make("shapechanger/InvertedPendulum-v1")) as pole,
    ):
        with pytest.raises(EmptyShift, match="nothing to transfer"):
            VehicleEnv.certify_shift(car, same)
        lines = VehicleEnv.certify_shift(car, dark).splitlines()
        assert lines[1:4] == ["Changes:", "  lenses: none -> night", "Rollout:"]
        straight = lines[4].partition("steps: ")[2].split(" -> ")
        assert straight[0] == straight[1]
        assert VehicleEnv.certify_shift(car, lame).splitlines()[1] == "Rollout:"
        for source, target in ((car, pole), (pole, car)):
            with pytest.raises(MorphologyError, match=r"is not a vehicle|has no model"):
                source.unwrapped.certify_shift(source, target)  # pyright: ignore[reportAttributeAccessIssue]
