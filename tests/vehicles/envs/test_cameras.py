"""The camera of the profile in every simulation, with one or more threads."""

from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import shapechanger
from shapechanger.errors import ProfileError
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.profile.load import find_profile
from shapechanger.robot.twin.start import Place, open_world
from shapechanger.vehicles.cameras.rectify import CameraGeometry, Rectifier
from shapechanger.vehicles.envs import RangesEnv, WaypointEnv
from shapechanger.vehicles.twin import course_place

# The camera of lab-car, and other cameras.
_LAB = CameraPlan("picamera2", (160, 120), pitch_deg=0.0, fovy_deg=48.8)
_OTHERS = [
    CameraPlan("v4l2", (160, 120), pitch_deg=8.0, fovy_deg=70.0),
    CameraPlan("v4l2", (320, 240), pitch_deg=-6.0, fovy_deg=85.0),
    CameraPlan("picamera2", (160, 90), pitch_deg=2.0, fovy_deg=41.0),
]


def _profile(folder: Path, camera: CameraPlan, vehicle: str = "car") -> Path:
    path = folder / f"{vehicle}.toml"
    stated = {
        "size": f"size = {list(camera.size)}",
        "pitch_deg": f"pitch_deg = {camera.pitch_deg}",
        "fovy_deg": f"fovy_deg = {camera.fovy_deg}",
    }
    lines = find_profile(f"lab-{vehicle}").read_text().splitlines()
    path.write_text("\n".join(stated.get(line.partition(" ")[0], line) for line in lines))
    return path


_AT = {"options": {"course": 11, "start": 11}}


def _seen(by: str, folder: Path, camera: CameraPlan) -> NDArray[np.uint8]:
    profile = _profile(folder, camera)
    if by.startswith("waypoints"):
        with closing(WaypointEnv("car", robot=profile, sensed="sensed" in by)) as env:
            return env.reset(**_AT)[0]
    if by == "ranges":
        with closing(RangesEnv("car", robot=profile, render_mode="rgb_array")) as env:
            env.reset(**_AT)
            picture: Any = env.render()
    else:
        place = Place() if by == "room" else course_place("corridor", "car")
        world: Any = open_world(place, {"wheels", "steering"}, camera, 3)
        picture = world.picture()
        if place.opener:
            world.close()
    assert camera.pitch_deg is not None
    assert camera.fovy_deg is not None
    return Rectifier(CameraGeometry(camera.pitch_deg, camera.fovy_deg), camera.size)(picture)


@pytest.mark.gl
@pytest.mark.usefixtures("gl")
@pytest.mark.parametrize("by", ["room", "waypoints", "waypoints, sensed", "ranges", "twin"])
def test_every_simulation_has_the_camera_of_the_profile(by: str, tmp_path: Path) -> None:
    """Warped frames of other cameras agree with warped frames of lab-car's camera."""
    expected = _seen(by, tmp_path, _LAB).astype(np.float64)
    # The difference of the image from itself, shifted by a pixel, is the scale of rounding.
    aside = np.abs(expected[:, 1:] - expected[:, :-1]).mean()
    for camera in _OTHERS:
        gap = np.abs(_seen(by, tmp_path, camera) - expected).mean()
        assert gap < 1.3 * aside, (camera, gap, aside)


@pytest.mark.parametrize("sensed", [False, True])
def test_a_camera_that_sees_too_little_is_refused(tmp_path: Path, sensed: bool) -> None:
    profile = _profile(tmp_path, CameraPlan("v4l2", (160, 120), pitch_deg=0.0, fovy_deg=41.0))
    with pytest.raises(ProfileError, match=r"car.toml: .* 41 degrees misses 20 % .* wider frames"):
        WaypointEnv("car", robot=profile, sensed=sensed)


@pytest.mark.gl
@pytest.mark.usefixtures("gl")
def test_pictures_do_not_depend_on_threads() -> None:
    def pictures(threads: int) -> list[Any]:
        options: dict[str, Any] = {"size": (48, 32), "render_mode": "rgb_array"}
        envs = shapechanger.make_vec(
            "Car", 3, threads=threads, autoreset_mode="Disabled", **options
        )
        seen: list[Any] = [envs.reset(seed=0)[0]]
        for number in range(3):
            mask = np.arange(3) == number
            seen.append(envs.reset(seed=[1, 2, 3], options={"reset_mask": mask})[0])
            seen.append(envs.step(np.full(envs.action_space.shape, 0.5, np.float32))[0])
        seen += envs.render()
        envs.close()
        return seen

    for one, two in zip(pictures(1), pictures(2), strict=True):
        assert one.std() > 5.0
        np.testing.assert_array_equal(one, two)
