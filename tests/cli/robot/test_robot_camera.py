"""`shapechanger robot camera`: writes a camera's measured geometry into the profile."""

import os
from pathlib import Path

import numpy as np
import pytest
import simplejpeg
from numpy.typing import NDArray

from shapechanger.cli import main
from shapechanger.robot.profile.load import load_profile
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


def test_a_board_is_measured_written_and_drawn(
    profile: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without a board, the drawing uses the profile."""
    picture = _jpeg(tmp_path / "board.jpg", board_picture(4.0, 48.8, 35.0))
    main(["robot", "camera", str(profile), "--picture", picture, "--board", "7x5"])
    camera = load_profile(profile).camera
    assert camera is not None
    assert camera.pitch_deg == pytest.approx(4.0, abs=0.15)
    assert camera.fovy_deg == pytest.approx(48.8, abs=0.5)
    assert "pitch 4.0" in capsys.readouterr().out
    first = Path("camera.jpg").read_bytes()
    assert simplejpeg.decode_jpeg(first).shape == (240, 320 + 400, 3)
    main(["robot", "camera", str(profile), "--picture", picture, "--out", "again.jpg"])
    assert Path("again.jpg").read_bytes() == first


def test_a_mark_at_the_height_of_the_lens_is_enough(profile: Path, tmp_path: Path) -> None:
    """--horizon and --fovy replace the board."""
    picture = _jpeg(tmp_path / "wall.jpg", np.full((120, 160, 3), 90, np.uint8))
    options = ["--picture", picture, "--horizon", "50", "--fovy", "48.8"]
    main(["robot", "camera", str(profile), *options])
    camera = load_profile(profile).camera
    assert camera is not None
    assert (camera.pitch_deg, camera.fovy_deg) == (4.3, 48.8)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--board", "nine"], "such as 9x6, got 'nine'"),
        (["--board", "7x5"], "no checkerboard of 7 x 5"),
        (["--board", "7x5", "--horizon", "3"], "not both"),
        (["--horizon", "50"], "--fovy"),
        (["--fovy", "0"], "10 to 170, got 0"),
        (["--fovy", "48.8"], "give --board or --horizon"),
        (["--horizon", "121", "--fovy", "48.8"], "from 0 to 120"),
        ([], "does not state pitch_deg and fovy_deg"),
    ],
)
def test_unsuitable_options_are_refused(
    profile: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    options: list[str],
    message: str,
) -> None:
    """One sentence, and the profile is unchanged."""
    before = profile.read_bytes()
    picture = _jpeg(tmp_path / "wall.jpg", np.full((120, 160, 3), 90, np.uint8))
    with pytest.raises(SystemExit):
        main(["robot", "camera", str(profile), "--picture", picture, *options])
    assert message in capsys.readouterr().err
    assert profile.read_bytes() == before
    assert not Path("camera.jpg").exists()


def test_shipped_profiles_and_invalid_images_are_refused(
    profile: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "text.jpg").write_bytes(b"no picture")
    (tmp_path / "noise.jpg").write_bytes(b"\xff\xd8\xff" + bytes(100))
    (tmp_path / "bomb.jpg").write_bytes(huge())
    with (tmp_path / "sparse.jpg").open("wb") as file:
        file.truncate(1 << 33)
    os.mkfifo(tmp_path / "pipe.jpg")
    for robot, options, message in (
        ("lab-car", ["--fovy", "50"], "comes with Shapechanger"),
        (str(profile), ["--picture", "text.jpg"], "is not a JPEG"),
        (str(profile), ["--picture", "none.jpg"], "Cannot read none.jpg"),
        (str(profile), ["--picture", "noise.jpg"], "noise.jpg is not a JPEG, or is damaged"),
        (str(profile), ["--picture", "bomb.jpg"], "more than the limit of 16777216"),
        (str(profile), ["--picture", "sparse.jpg"], "Cannot read sparse.jpg: it has"),
        (str(profile), ["--picture", "pipe.jpg"], "Cannot read pipe.jpg: it is not a regular file"),
        (
            str(profile),
            ["--picture", "/dev/zero"],
            "Cannot read /dev/zero: it is not a regular file",
        ),
    ):
        with pytest.raises(SystemExit):
            main(["robot", "camera", robot, *options])
        assert message in capsys.readouterr().err
