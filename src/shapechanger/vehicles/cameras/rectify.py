"""Images of any vehicle's camera as one virtual camera would have taken them.

Vehicles mount their cameras at different angles, and some cameras see the vehicle's bonnet. The
virtual camera looks level, has one field of view, and sees no part of the vehicle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import DemosError, WorldError, needing_extra

if TYPE_CHECKING:
    from shapechanger.demos.episodes import EpisodeHeader

CANONICAL_SIZE: Final = (80, 48)
"""Width and height of a rectified image, pixels."""

# Focal length of the virtual camera and row of its horizon, pixels: 31 degrees to each side, 18 up,
# and 21 down, where the car's bonnet begins.
_FOCAL: Final = 66.0
_HORIZON: Final = 22.0
HALF_WIDTH_RAD: Final = math.atan(0.5 * CANONICAL_SIZE[0] / _FOCAL)
"""Bearing of the left and right edge of a rectified image, rad."""

_SAMPLES: Final = 3  # Samples of a pixel in each direction.
_NEAREST: Final = 1e-3  # Depth of a ray below which it points sideways or behind the camera.
_MOST_MISSING: Final = 0.15  # Largest share of the virtual camera's pixels without an image.

# Vertical fields of view at which the search for the camera's field of view starts, degrees.
_FIRST_FOVY_DEG: Final = (30.0, 48.0, 70.0, 100.0)
# Largest accepted standard deviations of a camera's pitch and field of view, degrees.
_PITCH_SD_DEG, _FOVY_SD_DEG = 1.0, 2.5
_MOST_TILT_DEG: Final = 45.0
_CORNER_SD_PX: Final = 0.1
_YELLOW: Final = (255, 220, 0)


@dataclass(frozen=True, slots=True)
class CameraGeometry:
    """Pitch and field of view of a camera.

    Attributes:
        pitch_deg: Angle of the optical axis below the horizon, degrees, above -90 and below 90.
        fovy_deg: Vertical field of view, degrees, above 0 and below 180.

    Raises:
        WorldError: If an angle is out of its range.
    """

    pitch_deg: float
    fovy_deg: float

    def __post_init__(self) -> None:
        if not (abs(self.pitch_deg) < 90.0 and 0.0 < self.fovy_deg < 180.0):
            raise WorldError(
                "A camera's pitch must be above -90 and below 90 degrees and its field of view "
                f"above 0 and below 180, got {self.pitch_deg:g} and {self.fovy_deg:g}."
            )


class Rectifier:
    """Warps images of one camera, of a width and height in pixels, to the virtual camera.

    Each pixel of the virtual camera is a ray, which is turned by the pitch to find the pixel of the
    real camera. Differences in the height of cameras are not corrected. A WorldError is raised if
    the camera misses more than 15 % of the virtual camera's pixels.
    """

    def __init__(self, geometry: CameraGeometry, size: tuple[int, int]) -> None:
        wide, high = size
        columns, rows = CANONICAL_SIZE
        # A pixel is the mean of the samples within it.
        part = (np.arange(_SAMPLES) + 0.5) / _SAMPLES
        u = (np.arange(columns)[:, None] + part).ravel()
        v = (np.arange(rows)[:, None] + part).ravel()
        column, row = _seen_at(geometry, size, *np.meshgrid(u, v))
        missing = np.mean((column < 0) | (column >= wide) | (row < 0) | (row >= high))
        if missing > _MOST_MISSING:
            raise WorldError(
                f"A camera that looks {geometry.pitch_deg:g} degrees down with a vertical field "
                f"of view of {geometry.fovy_deg:g} degrees misses {100 * missing:.0f} % of the "
                "view that all vehicles share, 18 degrees above the horizon to 21 below and 31 to "
                f"each side, in frames of {wide} x {high} pixels: turn the camera level, or use "
                "wider frames from its whole sensor, or a wider lens."
            )
        places = np.clip(row, 0, high - 1) * wide + np.clip(column, 0, wide - 1)
        shape = (rows, _SAMPLES, columns, _SAMPLES)
        self._places = places.reshape(shape).transpose(1, 3, 0, 2).reshape(-1, rows * columns)
        self._shape = (high, wide, 3)

    def __call__(self, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Warp an image, (height, width, 3), to the shape (48, 80, 3).

        Pixels outside the real camera's view repeat the nearest pixel inside it.
        """
        if picture.shape != self._shape:
            raise WorldError(
                f"The images of this camera must have the shape {self._shape}, got {picture.shape}."
            )
        pixels = picture.reshape(-1, 3)
        total = np.zeros((self._places.shape[1], 3), np.uint16)
        for places in self._places:
            total += pixels[places]
        mean = (total + self._places.shape[0] // 2) // self._places.shape[0]
        return mean.astype(np.uint8).reshape(CANONICAL_SIZE[1], CANONICAL_SIZE[0], 3)


class CanonicalView:
    """Warps images to the virtual camera, by default from the camera that each episode states."""

    def __init__(self, camera: CameraGeometry | None = None) -> None:
        self._camera = camera
        self.rectifiers: dict[tuple[CameraGeometry, tuple[int, int]], Rectifier] = {}
        self._bodies: set[str] = set()

    def __call__(self, picture: NDArray[np.uint8], header: EpisodeHeader) -> NDArray[np.uint8]:
        """Warp an image of an episode; images of episodes with waypoints are warped already.

        Raises a DemosError if the camera is unknown, or the episodes are of several bodies.
        """
        self._bodies.add(header.body)
        if len(self._bodies) > 1:
            raise DemosError(
                f"These demonstrations are of several bodies, {', '.join(sorted(self._bodies))}, "
                "which turn differently: give demonstrations of one body at a time."
            )
        if header.action_layout.names[0].startswith("waypoint/"):
            return picture
        camera, (pitch, fovy) = self._camera, header.camera_deg
        if camera is None:
            if pitch is None or fovy is None:
                raise DemosError(
                    "The recording does not state pitch and field of view of its camera: give "
                    "--camera PITCH FOVY, in degrees, which `shapechanger robot camera` measures."
                )
            camera = CameraGeometry(pitch, fovy)
        key = camera, (picture.shape[1], picture.shape[0])
        if key not in self.rectifiers:
            self.rectifiers[key] = Rectifier(*key)
        return self.rectifiers[key](picture)

    def note(self) -> str:
        """Return a sentence on the cameras."""
        cameras = sorted({(one.pitch_deg, one.fovy_deg) for one, _ in self.rectifiers})
        each = " and ".join(
            f"looks {pitch:.3g} degrees down with a vertical field of view of {fovy:.3g}"
            for pitch, fovy in cameras
        )
        return f"Images are warped to the view that all vehicles share; their camera {each}."


@dataclass(frozen=True, slots=True)
class MeasuredCamera:
    """A camera's geometry from an image of a checkerboard, with standard deviations."""

    geometry: CameraGeometry
    roll_deg: float  # Turn about the optical axis, clockwise in the direction of view.
    pitch_sd_deg: float
    fovy_sd_deg: float  # 0 if the field of view was given.
    error_px: float  # Root mean square distance of detected from fitted corners, pixels.


def pitch_of_horizon(row: float, height: int, fovy_deg: float) -> float:
    """Return the angle of the optical axis below the horizon, degrees.

    `row` is the row of the horizon from the top of an image of this height, pixels.
    """
    if not 0.0 <= row <= height:
        raise WorldError(f"The horizon must be in a row from 0 to {height}, got {row:g}.")
    half = 0.5 * height
    return math.degrees(math.atan((half - row) / half * math.tan(0.5 * math.radians(fovy_deg))))


def measure_camera(
    picture: NDArray[np.uint8], corners: tuple[int, int], fovy_deg: float | None = None
) -> MeasuredCamera:
    """Measure a camera's geometry from one image of a checkerboard that stands upright.

    OpenCV finds the inner `corners` along the two sides of the board, and fits focal length and
    pose of a camera without distortion, with square pixels and its axis in the middle. `picture`,
    (height, width, 3), has the camera's whole field of view. Without `fovy_deg`, degrees, the board
    must be turned by some 30 to 45 degrees: seen straight on, a near board in a wide field of view
    looks like a far board in a narrow one. Raises a WorldError if the image shows no such board, or
    one that is tilted or does not determine the geometry.
    """
    with needing_extra("camera"):
        import cv2
    height, width = picture.shape[:2]
    if min(corners) < 3:
        raise WorldError(f"A board needs at least 3 inner corners along each side, got {corners}.")
    grey = np.ascontiguousarray(picture.mean(axis=2).astype(np.uint8))
    search = cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY
    found, points = cv2.findChessboardCornersSB(grey, corners, flags=search)
    if not found:
        raise WorldError(
            f"There is no checkerboard of {corners[0]} x {corners[1]} inner corners in this image "
            f"of {width} x {height} pixels: show all of it, near and in even light."
        )
    points = np.asarray(points, np.float32)  # (n, 1, 2).
    board = np.zeros((len(points), 3), np.float32)
    board[:, :2] = np.mgrid[: corners[0], : corners[1]].T.reshape(-1, 2)
    flags = cv2.CALIB_USE_INTRINSIC_GUESS | cv2.CALIB_FIX_ASPECT_RATIO
    flags |= cv2.CALIB_FIX_PRINCIPAL_POINT | cv2.CALIB_ZERO_TANGENT_DIST
    flags |= cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3
    if fovy_deg is not None:
        flags |= cv2.CALIB_FIX_FOCAL_LENGTH
    fits: list[tuple[Any, ...]] = []
    for first in _FIRST_FOVY_DEG if fovy_deg is None else (fovy_deg,):
        focal = 0.5 * height / math.tan(0.5 * math.radians(first))
        lens = np.diag((focal, focal, 1.0))
        lens[:2, 2] = 0.5 * (width - 1), 0.5 * (height - 1)
        size = (width, height)
        fits.append(
            cv2.calibrateCameraExtended([board], [points], size, lens, np.zeros(5), flags=flags)
        )
    error, lens, _, turns, _, lens_sd, pose_sd, _ = min(fits, key=lambda fit: fit[0])
    # Corners are detected to 0.1 pixels at best in each direction, even if the fit is better.
    scale = max(1.0, math.sqrt(2.0) * _CORNER_SD_PX / error)
    focal = float(lens[1, 1])
    fovy = math.degrees(2.0 * math.atan(0.5 * height / focal))
    # d fovy / d focal = -sin(fovy) / focal.
    fovy_sd = scale * float(lens_sd[1, 0]) * math.degrees(math.sin(math.radians(fovy))) / focal
    turn, slopes = cast("tuple[NDArray[np.float64], ...]", cv2.Rodrigues(turns[0]))
    # The side of the board that is nearer to the vertical of the image points down.
    side = int(np.argmax(np.abs(turn[1, :2])))
    sign = math.copysign(1.0, turn[1, side])
    sine = float(sign * turn[2, side])
    pitch = math.degrees(math.asin(sine))
    pitch_sd = scale * math.degrees(
        float(np.linalg.norm(slopes[:, 6 + side] * pose_sd[:3, 0])) / math.sqrt(1.0 - sine**2)
    )
    if abs(pitch) > _MOST_TILT_DEG:
        raise WorldError(
            f"The board must stand upright, but is tilted by {abs(pitch):.0f} degrees."
        )
    if pitch_sd > _PITCH_SD_DEG or fovy_sd > _FOVY_SD_DEG:
        raise WorldError(
            f"This image leaves the pitch uncertain by {pitch_sd:.1f} degrees and the field of "
            f"view by {fovy_sd:.1f}: bring the board nearer, turn it by 30 to 45 degrees, or give "
            "the field of view of the camera's data sheet."
        )
    roll = math.degrees(math.atan2(sign * turn[0, side], sign * turn[1, side]))
    return MeasuredCamera(CameraGeometry(pitch, fovy), roll, pitch_sd, fovy_sd, error)


def draw_view(picture: NDArray[np.uint8], geometry: CameraGeometry) -> NDArray[np.uint8]:
    """Draw the horizon and the edge of the virtual camera's view on a copy of an image, (h, w, 3).

    Both lines are yellow; the horizon is dotted.
    """
    height, width = picture.shape[:2]
    Rectifier(geometry, (width, height))
    columns, rows = CANONICAL_SIZE
    along, none = np.linspace(0.0, 1.0, 2 * (width + height)), np.zeros(2 * (width + height))
    edges = ((along, none), (along, none + 1.0), (none, along), (none + 1.0, along))
    lines = [(columns * x, rows * y) for x, y in edges]
    lines.append((columns * along[::8], none[::8] + _HORIZON))
    drawn = picture.copy()
    for x, y in lines:
        column, row = _seen_at(geometry, (width, height), x, y)
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        drawn[row[inside], column[inside]] = _YELLOW
    return drawn


def _seen_at(
    geometry: CameraGeometry, size: tuple[int, int], x: NDArray[np.float64], y: NDArray[np.float64]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return columns and rows of a camera's pixels at x and y in the virtual image, pixels.

    Points behind the camera are at (-1, -1). `size` is the width and height of its images.
    """
    wide, high = size
    focal = 0.5 * high / math.tan(0.5 * math.radians(geometry.fovy_deg))
    down = math.radians(geometry.pitch_deg)
    right, below = (x - 0.5 * CANONICAL_SIZE[0]) / _FOCAL, (y - _HORIZON) / _FOCAL  # At depth 1.
    depth = below * math.sin(down) + math.cos(down)
    ahead = np.maximum(depth, _NEAREST)
    column = focal * right / ahead + 0.5 * wide
    row = focal * (below * math.cos(down) - math.sin(down)) / ahead + 0.5 * high
    behind = depth < _NEAREST
    column[behind] = row[behind] = -1.0
    return np.floor(column).astype(np.intp), np.floor(row).astype(np.intp)
