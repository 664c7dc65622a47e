"""A rectangular room with a few boxes, and its picture from the vehicle."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.contract.world import Pose

ROOM_LENGTH: Final = 6.0  # m, along x
ROOM_WIDTH: Final = 4.0  # m, along y
BOXES: Final = 5
SMALLEST_BOX: Final = 0.25  # m, a side
LARGEST_BOX: Final = 0.6  # m
CLEARANCE: Final = 0.7  # m that stay free between boxes, so that the vehicle fits through
START_CLEARANCE: Final = 0.45  # m that are free around a start
START_AHEAD: Final = 1.4  # m that are free ahead of a start
_LOOK_AHEAD: Final = np.radians(np.array((-15.0, -7.0, 0.0, 7.0, 15.0)))
_TRIES: Final = 2000


@dataclass(frozen=True, slots=True)
class Box:
    """A rectangle along the axes, in metres."""

    left: float
    bottom: float
    right: float
    top: float

    def apart(self, other: Box) -> float:
        """Return the larger of the distances along both axes; at most 0 if the boxes touch."""
        return max(
            other.left - self.right,
            self.left - other.right,
            other.bottom - self.top,
            self.bottom - other.top,
        )

    def gap(self, x: float, y: float) -> float:
        """Return the distance from a point outside, m.

        Args:
            x: Of the point, m.
            y: Of the point, m.
        """
        return math.hypot(
            max(self.left - x, 0.0, x - self.right), max(self.bottom - y, 0.0, y - self.top)
        )


class Room:
    """Walls and boxes.

    Args:
        length: Along x, in metres; the room begins at 0.
        width: Along y, in metres; the room begins at 0.
        boxes: Boxes in it.

    Attributes:
        starts: (N, 2) start of each wall segment.
        edges: (N, 2) from its start to its end.
    """

    def __init__(self, length: float, width: float, boxes: tuple[Box, ...]) -> None:
        self.length = length
        self.width = width
        self.boxes = boxes
        corners: list[NDArray[np.float64]] = []
        for box in (Box(0.0, 0.0, length, width), *boxes):
            corners.append(
                np.array(
                    [
                        (box.left, box.bottom),
                        (box.right, box.bottom),
                        (box.right, box.top),
                        (box.left, box.top),
                    ]
                )
            )
        self.starts = np.concatenate(corners)
        self.edges = np.concatenate([np.roll(c, -1, axis=0) - c for c in corners])

    def clearance(self, x: float, y: float) -> tuple[float, float, float]:
        """Find the nearest point of a wall or box.

        Args:
            x: Of the point to start from, m.
            y: Of the point to start from, m.

        Returns:
            Distance, negative outside the room, and x and y of the nearest point, m.
        """
        nearest = min(
            (x, 0.0, y),
            (self.length - x, self.length, y),
            (y, x, 0.0),
            (self.width - y, x, self.width),
        )
        for box in self.boxes:
            gap = box.gap(x, y)
            if gap < nearest[0]:
                nearest = (
                    gap,
                    min(max(x, box.left), box.right),
                    min(max(y, box.bottom), box.top),
                )
        return nearest

    def cast(
        self, x: float, y: float, directions: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.intp], NDArray[np.float64]]:
        """Return the end points of rays from a point.

        Args:
            x: Of the point.
            y: Of the point.
            directions: (R, 2) directions; distances are in units of their length.

        Returns:
            Distance (R,), number of the segment that was hit (R,), and metres along it (R,).
        """
        to_start_x, to_start_y = self.starts[:, 0] - x, self.starts[:, 1] - y
        edge_x, edge_y = self.edges[:, 0], self.edges[:, 1]
        ray_x, ray_y = directions[:, :1], directions[:, 1:]
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = 1.0 / (ray_x * edge_y - ray_y * edge_x)  # (R, N)
            distance = (to_start_x * edge_y - to_start_y * edge_x) * scale
            share = (to_start_x * ray_y - to_start_y * ray_x) * scale
            hits = (distance > 0.0) & (share >= 0.0) & (share <= 1.0)
        distance = np.where(hits, distance, np.inf)
        segment = distance.argmin(axis=1)
        rays = np.arange(len(directions))
        along = share[rays, segment] * np.hypot(edge_x, edge_y)[segment]
        return distance[rays, segment], segment, along


def lay_out(seed: int) -> Room:
    """Return the room of a seed."""
    rng = random.Random(f"room {seed}")
    boxes: list[Box] = []
    for _ in range(40 * BOXES):
        length = rng.uniform(SMALLEST_BOX, LARGEST_BOX)
        width = rng.uniform(SMALLEST_BOX, LARGEST_BOX)
        left, bottom = rng.uniform(0.0, ROOM_LENGTH - length), rng.uniform(0.0, ROOM_WIDTH - width)
        box = Box(left, bottom, left + length, bottom + width)
        if all(box.apart(other) > CLEARANCE for other in boxes):
            boxes.append(box)
        if len(boxes) == BOXES:
            break
    return Room(ROOM_LENGTH, ROOM_WIDTH, tuple(boxes))


def find_start(room: Room, seed: int) -> Pose:
    """Return a start with free space around and more of it ahead.

    Args:
        room: The room.
        seed: Seed of the start.
    """
    rng = random.Random(f"start {seed}")
    best, best_pose = -math.inf, Pose(room.length / 2, room.width / 2, 0.0)
    for _ in range(_TRIES):
        x, y = rng.uniform(0.0, room.length), rng.uniform(0.0, room.width)
        heading = rng.uniform(-math.pi, math.pi)
        around = room.clearance(x, y)[0] - START_CLEARANCE
        angles = heading + _LOOK_AHEAD
        directions = np.stack((np.cos(angles), np.sin(angles)), axis=1)
        ahead = around
        if around > 0.0:
            ahead = float(room.cast(x, y, directions)[0].min()) - START_AHEAD
        if (free := min(around, ahead)) > best:
            best, best_pose = free, Pose(x, y, heading)
        if best > 0.0:
            break
    return best_pose


FIELD_OF_VIEW: Final = math.radians(90.0)  # From left to right, where no profile states another.
CAMERA_HEIGHT: Final = 0.12  # m above the floor
WALL_HEIGHT: Final = 0.4  # m
STRIPE: Final = 0.25  # m: width of the stripes on walls
FADE: Final = 4.0  # m at which a wall has lost 63 % of its light
_STEEP: Final = 0.75  # Slope of a line of sight at which floor and ceiling are lightest.
_RAYS: Final = 2  # For each column of a picture.
_ROUNDING: Final = 1e-9

_CEILING: Final = np.array((205.0, 210.0, 215.0), np.float32)
_FLOOR: Final = np.array((120.0, 95.0, 70.0), np.float32)
_WALLS: Final = np.array(
    (
        (220, 70, 60),
        (70, 150, 220),
        (235, 190, 60),
        (90, 180, 90),
        (180, 90, 190),
        (230, 130, 50),
        (80, 190, 190),
        (200, 200, 200),
    ),
    np.float32,
)


class FrontCamera:
    """Draws the room as the vehicle sees it.

    Args:
        size: Width and height of the pictures in pixels.
        pitch_deg: Angle of the optical axis below the horizon, degrees; None for level.
        fovy_deg: Vertical field of view, degrees; None for `FIELD_OF_VIEW` from left to right.
    """

    def __init__(
        self,
        size: tuple[int, int],
        pitch_deg: float | None = None,
        fovy_deg: float | None = None,
    ) -> None:
        width, height = size
        if fovy_deg is None:
            focal = (width / 2) / math.tan(FIELD_OF_VIEW / 2)  # In pixels.
        else:
            focal = (height / 2) / math.tan(math.radians(fovy_deg) / 2)
        pitch = math.radians(pitch_deg or 0.0)
        right = (np.arange(width) + 0.5 - width / 2) / focal
        below = ((np.arange(height) + 0.5 - height / 2) / focal)[:, np.newaxis]
        ahead = math.cos(pitch) - math.sin(pitch) * below
        down = math.sin(pitch) + math.cos(pitch) * below
        # One ray along the floor serves all pixels of a bearing.
        bearings = -np.arctan2(right, ahead)
        first, last = float(bearings.min()), float(bearings.max())
        self._angles = np.linspace(first, last, _RAYS * width)
        step = max(last - first, _ROUNDING) / (_RAYS * width - 1)
        self._rays = np.rint((bearings - first) / step).astype(np.intp)
        # How far a pixel looks down for each metre along the floor.
        self._slopes = (down / np.hypot(right, ahead)).astype(np.float32)
        # Light falls off towards the horizon, on the floor and on the ceiling.
        near = np.minimum(np.abs(self._slopes) / _STEEP, 1.0)[..., np.newaxis]
        self._background = np.where(
            self._slopes[..., np.newaxis] > 0.0,
            _FLOOR * (0.55 + 0.45 * near),
            _CEILING * (0.8 + 0.2 * near),
        ).astype(np.uint8)

    def picture(self, room: Room, x: float, y: float, heading: float) -> NDArray[np.uint8]:
        """Draw a picture, RGB, shape (height, width, 3).

        Args:
            room: The room.
            x: Position of the camera, m.
            y: Position of the camera, m.
            heading: Angle of its axis from the x axis, rad, counter-clockwise.
        """
        angles = heading + self._angles
        directions = np.stack((np.cos(angles), np.sin(angles)), axis=1)
        distance, segment, along = room.cast(x, y, directions)
        distance = np.maximum(distance, 0.02).astype(np.float32)
        light = 0.25 + 0.75 * np.exp(-distance / np.float32(FADE))
        light *= np.where((along // STRIPE) % 2 == 0, 1.0, 0.72).astype(np.float32)
        colours = (_WALLS[segment % len(_WALLS)] * light[:, np.newaxis]).astype(np.uint8)
        rise = self._slopes * distance[self._rays]  # Below the camera where it meets the wall, m.
        wall = (rise >= CAMERA_HEIGHT - WALL_HEIGHT) & (rise < CAMERA_HEIGHT)
        picture = self._background.copy()
        picture[wall] = colours[self._rays[wall]]
        return picture
