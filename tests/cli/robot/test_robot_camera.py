"""`shapechanger robot camera`: writes a camera's measured geometry into the profile."""

import os
from pathlib import Path

import numpy as np
import pytest
import simplejpeg
from numpy.typing import NDArray

from shapechanger.robot.profile.load import load_profile
from tests.cli.running import Cli
from tests.demos.exchange.small import huge
from tests.robots import CAR, write_profile
from tests.vehicles.cameras.test_rectify import board_picture


@pytest.fixture(autouse=True)
def profile(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A profile whose camera has not been measured."""
    monkeypatch.chdir(tmp_path)
    return write_profile(tmp_path, CAR).path


def _jpeg(path: Path, picture: NDArray[np.uint8]) -> str:
    path.write_bytes(simplejpeg.encode_jpeg(np.ascontiguousarray(picture), 95))
    return str(path)


def test_a_board_is_measured_written_and_drawn(profile: Path, tmp_path: Path, cli: Cli) -> None:
    picture = _jpeg(tmp_path / "board.jpg", board_picture(4.0, 48.8, 35.0))
    said = cli.output("robot", "camera", profile, "--picture", picture, "--board", "7x5")
    camera = load_profile(profile).camera
    assert camera is not None
    assert camera.pitch_deg == pytest.approx(4.0, abs=0.15)
    assert camera.fovy_deg == pytest.approx(48.8, abs=0.5)
    assert "pitch 4.0" in said
    first = Path("camera.jpg").read_bytes()
    assert simplejpeg.decode_jpeg(first).shape == (240, 320 + 400, 3)
    cli.output("robot", "camera", profile, "--picture", picture, "--out", "again.jpg")
    assert Path("again.jpg").read_bytes() == first


def test_the_pitch_is_measured_from_a_horizon(profile: Path, tmp_path: Path, cli: Cli) -> None:
    picture = _jpeg(tmp_path / "wall.jpg", np.full((120, 160, 3), 90, np.uint8))
    options = ("--picture", picture, "--horizon", "50", "--fovy", "48.8")
    cli.output("robot", "camera", profile, *options)
    camera = load_profile(profile).camera
    assert camera is not None
    assert (camera.pitch_deg, camera.fovy_deg) == (4.3, 48.8)


@pytest.mark.parametrize(
    ("robot", "options", "message"),
    [
        ("test-car.toml", "--picture wall.jpg --board nine", "such as 9x6, got 'nine'"),
        ("test-car.toml", "--picture wall.jpg --board 7x5", "no checkerboard of 7 x 5"),
        ("test-car.toml", "--picture wall.jpg --board 7x5 --horizon 3", "not both"),
        ("test-car.toml", "--picture wall.jpg --horizon 50", "--fovy"),
        ("test-car.toml", "--picture wall.jpg --fovy 0", "must be 10 to 170 degrees, got 0"),
        ("test-car.toml", "--picture wall.jpg --fovy 48.8", "give --board or --horizon"),
        ("test-car.toml", "--picture wall.jpg --horizon 121 --fovy 48.8", "from 0 to 120"),
        ("test-car.toml", "--picture wall.jpg", "does not state pitch_deg and fovy_deg"),
        ("lab-car", "--fovy 50", "comes with Shapechanger"),
        ("test-car.toml", "--picture text.jpg", "is not a JPEG"),
        ("test-car.toml", "--picture bomb.jpg", "more than 16777216"),
        ("test-car.toml", "--picture sparse.jpg", "Cannot read sparse.jpg: it has"),
        ("test-car.toml", "--picture pipe.jpg", "it is not a regular file"),
        ("test-car.toml", "--picture /dev/zero", "it is not a regular file"),
    ],
)
def test_unsuitable_options_and_images_are_refused(
    profile: Path, tmp_path: Path, cli: Cli, robot: str, options: str, message: str
) -> None:
    before = profile.read_bytes()
    _jpeg(tmp_path / "wall.jpg", np.full((120, 160, 3), 90, np.uint8))
    (tmp_path / "text.jpg").write_bytes(b"no picture")
    (tmp_path / "bomb.jpg").write_bytes(huge())
    with (tmp_path / "sparse.jpg").open("wb") as file:
        file.truncate(1 << 33)
    os.mkfifo(tmp_path / "pipe.jpg")
    assert message in cli.refused("robot", "camera", robot, *options.split())
    assert profile.read_bytes() == before
    assert not Path("camera.jpg").exists()
