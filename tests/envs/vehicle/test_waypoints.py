"""The waypoint env, and measuring a steering response."""

from __future__ import annotations

import math
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from shapechanger.bodies.vehicles import vehicle_model
from shapechanger.envs.catalogue import WAYPOINT_ENVS
from shapechanger.envs.vehicle import RangesEnv, WaypointEnv
from shapechanger.envs.waypoints import AHEAD_M, SteeringResponse, measure_response
from shapechanger.errors import ProfileError, SpaceMismatch, StudyError
from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.worlds.course import HOME

_COURSE = {"course": 2, "start": 2}


def test_steering_follows_from_the_bearing() -> None:
    """Steering has the bearing's sign and saturates."""
    car, tank = SteeringResponse(2.0, 0.0), SteeringResponse(0.0, 4.0)
    assert car.steering(0.0, 1.0) == 0.0
    assert car.steering(0.1, 1.0) == -car.steering(-0.1, 1.0) > 0.0
    assert car.steering(1.0, 1.0) == 1.0
    # For a car the steering does not depend on the speed, for tracks it grows with it.
    assert car.steering(0.2, 2.0) == pytest.approx(car.steering(0.2, 1.0))
    assert tank.steering(0.2, 1.0) == pytest.approx(2.0 * tank.steering(0.2, 0.5))
    assert tank.steering(0.2, 1.0) == pytest.approx(2.0 * math.sin(0.2) / AHEAD_M / 4.0)


@pytest.mark.parametrize("numbers", [(0.0, 0.0), (-1.0, 2.0), (math.nan, 1.0)])
def test_invalid_responses_are_refused(numbers: tuple[float, float]) -> None:
    """A response without a turn, or with the wrong sign, is refused."""
    with pytest.raises(StudyError, match="must turn to the right when it steers to the right"):
        SteeringResponse(*numbers)


@pytest.mark.parametrize("vehicle", HOME)
def test_profiles_have_the_simulated_cameras(vehicle: str) -> None:
    """The camera of each profile agrees with that of its body."""
    camera = load_profile(find_profile(f"lab-{vehicle}")).camera
    mount = vehicle_model(vehicle).camera
    assert camera is not None
    assert camera.pitch_deg == pytest.approx(math.degrees(mount.pitch_rad))
    assert camera.fovy_deg == mount.fovy_deg


def test_a_profile_without_the_geometry_is_refused(tmp_path: Path) -> None:
    """The error names the missing settings and the command that measures them."""
    lines = find_profile("lab-car").read_text().splitlines()
    path = tmp_path / "car.toml"
    path.write_text("\n".join(line for line in lines if not line.startswith("pitch_deg")))
    with pytest.raises(ProfileError, match=r"\[camera\] needs pitch_deg for waypoints: .* camera"):
        WaypointEnv("car", robot=path)


def test_the_measured_response_matches_the_geometry() -> None:
    """The measured response of the car is close to its geometry."""
    with closing(RangesEnv("car", put_back=True)) as env:
        places = env.observation_layout.slices
        found = measure_response(env, places["speed"].start, places["yaw_rate"].start)
    # The tangent of the full lock over the wheelbase, 1/m; the tyres slip a little.
    drawn = math.tan(math.radians(28.0)) / 0.26
    assert found.per_metre + found.per_second == pytest.approx(drawn, rel=0.15)


@pytest.mark.gl
@pytest.mark.usefixtures("gl")
@pytest.mark.parametrize(("env_id", "vehicle"), [(i, v) for i, (v, _) in WAYPOINT_ENVS.items()])
def test_following_true_waypoints_has_no_collisions(env_id: str, vehicle: str) -> None:
    """Following the expert's waypoints causes no collisions."""
    with closing(WaypointEnv(vehicle, put_back=True)) as env:
        seen, _ = env.reset(options=_COURSE)
        assert env.observation_space.contains(seen)
        guide = env.demonstrator(0)
        for _ in range(150):
            waypoint, _ = guide.act()
            assert env.action_space.contains(waypoint)
            *_, info = env.step(waypoint)
        assert info["collisions"] == 0, env_id
        assert info["progress"] > 2.0
        assert env.world.course.world == ("flooded-corridor" if vehicle == "boat" else "corridor")


@pytest.mark.gl
@pytest.mark.usefixtures("gl")
def test_the_full_robot_follows_waypoints() -> None:
    """The whole robot follows waypoints by its own sensors."""
    with closing(WaypointEnv("car", full_robot=True, put_back=True)) as env:
        env.reset(options=_COURSE)
        guide = env.demonstrator(0)
        for _ in range(60):
            seen, _, _, _, info = env.step(guide.act()[0])
        assert seen.shape == (48, 80, 3)
        assert info["collisions"] == 0
        assert info["progress"] > 3.0


@pytest.mark.gl
@pytest.mark.usefixtures("gl")
def test_invalid_waypoints_are_refused() -> None:
    """Other shapes and infinite values raise SpaceMismatch."""
    with closing(WaypointEnv("car")) as env:
        env.reset(options=_COURSE)
        for wrong in (np.zeros(3, np.float32), np.array([0.0, np.inf], np.float32)):
            with pytest.raises(SpaceMismatch, match="A waypoint is a bearing and a speed"):
                env.step(wrong)
