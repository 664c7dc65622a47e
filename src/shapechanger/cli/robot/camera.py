"""`shapechanger robot camera`: measure and draw pitch and field of view of a robot's camera."""

from __future__ import annotations

import re
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
import tyro
from numpy.typing import NDArray

from shapechanger.cli.console import say
from shapechanger.cli.robot.setup import change_profile, own_profile
from shapechanger.demos.jpeg import decode_picture
from shapechanger.errors import RobotError, translate_errors
from shapechanger.files import read_file, write_atomic
from shapechanger.robot.cameras.camera import CameraPlan, open_camera
from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.vehicles.cameras.rectify import (
    CANONICAL_SIZE,
    CameraGeometry,
    Rectifier,
    draw_view,
    measure_camera,
    pitch_of_horizon,
)

# Range of the vertical field of view that a profile accepts.
_LEAST_FOVY_DEG: Final = 10.0
_MOST_FOVY_DEG: Final = 170.0
_MOST_BYTES: Final = 2**25  # Largest image file.


@dataclass(frozen=True)
class RobotCamera:
    """Measure pitch and field of view of the camera, write them into the profile, and draw them.

    Without --board, --horizon and --fovy, the values of the profile are drawn.
    """

    profile: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="PROFILE")]
    """The robot's profile."""
    picture: Path | None = None
    """JPEG file of the whole field of view; if not given, the robot's camera takes an image."""
    board: str = ""
    """Inner corners along both sides of an upright checkerboard in view, such as 9x6."""
    horizon: float | None = None
    """Row of the horizon in the image, pixels from the top, for example of a distant mark at the
    height of the lens."""
    fovy: float | None = None
    """Vertical field of view, degrees, from the data sheet."""
    out: Path = Path("camera.jpg")
    """The drawing to write: the image with the horizon, and the view of waypoint policies."""

    def run(self) -> None:
        import simplejpeg

        if self.board and self.horizon is not None:
            raise RobotError("Give --board or --horizon, not both.")
        if self.fovy is not None and not _LEAST_FOVY_DEG <= self.fovy <= _MOST_FOVY_DEG:
            raise RobotError(
                f"--fovy must be {_LEAST_FOVY_DEG:g} to {_MOST_FOVY_DEG:g} degrees, got "
                f"{self.fovy:g}."
            )
        corners = None
        if self.board:
            sides = re.fullmatch(r"(\d+)x(\d+)", self.board)
            if not sides:
                raise RobotError(
                    "--board must be the inner corners along both sides, such as 9x6, got "
                    f"{self.board!r}."
                )
            corners = int(sides[1]), int(sides[2])
        measures = corners is not None or self.horizon is not None or self.fovy is not None
        path = own_profile(self.profile) if measures else find_profile(self.profile)
        profile = load_profile(path)
        if profile.camera is None:
            raise RobotError(f"{path} has no [camera].")
        picture = _picture(profile.camera, self.picture)
        if measures:
            found = self._measured(picture, corners, profile.camera)
            changes: dict[str, Any] = {
                "camera.pitch_deg": round(found.pitch_deg, 1),
                "camera.fovy_deg": round(found.fovy_deg, 1),
            }
            change_profile(path, changes)
            profile = load_profile(path)
        camera = profile.camera
        if camera is None or camera.pitch_deg is None or camera.fovy_deg is None:
            raise RobotError(
                f"{profile.path} does not state pitch_deg and fovy_deg of its camera: measure them "
                "with --board or --horizon."
            )
        drawing = _drawing(picture, CameraGeometry(camera.pitch_deg, camera.fovy_deg))
        write_atomic(self.out, simplejpeg.encode_jpeg(np.ascontiguousarray(drawing), 92))
        say(f"wrote {self.out}")

    def _measured(
        self, picture: NDArray[np.uint8], corners: tuple[int, int] | None, stated: CameraPlan
    ) -> CameraGeometry:
        if corners is not None:
            found = measure_camera(picture, corners, self.fovy)
            say(
                f"The corners fit to {found.error_px:.2f} pixels: pitch "
                f"{found.geometry.pitch_deg:.1f} ± {2 * found.pitch_sd_deg:.1f}, field of view "
                f"{found.geometry.fovy_deg:.1f} ± {2 * found.fovy_sd_deg:.1f}, roll "
                f"{found.roll_deg:.1f} degrees."
            )
            return found.geometry
        fovy = stated.fovy_deg if self.fovy is None else self.fovy
        if fovy is None:
            raise RobotError("Measuring the pitch from a horizon requires --fovy.")
        if self.horizon is not None:
            return CameraGeometry(pitch_of_horizon(self.horizon, picture.shape[0], fovy), fovy)
        if stated.pitch_deg is None:
            raise RobotError("The pitch is unknown: give --board or --horizon as well.")
        return CameraGeometry(stated.pitch_deg, fovy)


def _picture(plan: CameraPlan, path: Path | None) -> NDArray[np.uint8]:
    """Read an image from a file, or take one, shape (height, width, 3)."""
    if path is None:
        with closing(open_camera(plan)) as camera:
            return decode_picture(camera.read().jpeg, "of the robot's camera")
    with translate_errors(
        OSError, to=lambda error: RobotError(f"Cannot read {path}: {error.strerror or error}.")
    ):
        jpeg = read_file(path, _MOST_BYTES)
    return decode_picture(jpeg, str(path))


def _drawing(picture: NDArray[np.uint8], geometry: CameraGeometry) -> NDArray[np.uint8]:
    """Return the image with the virtual camera's view drawn in, and the view next to it."""
    height, width = (int(n) for n in picture.shape[:2])
    seen = Rectifier(geometry, (width, height))(picture)
    drawn = draw_view(picture, geometry)
    across, down = CANONICAL_SIZE
    rows = np.arange(height) * down // height
    columns = np.arange(height * across // down) * down // height
    return np.hstack((drawn, seen[rows][:, columns]))
