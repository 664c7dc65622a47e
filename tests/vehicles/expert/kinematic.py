"""Kinematic vehicles, sufficient to test the steering of drivers."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from shapechanger.contract.world import Pose
from shapechanger.vehicles.courses.course import Course
from shapechanger.vehicles.courses.geometry import ClearanceField

SIZES = {"car": (0.40, 0.20), "tank": (0.32, 0.24), "truck": (0.50, 0.20), "boat": (0.60, 0.20)}
TOP = {"car": 2.0, "tank": 1.0, "truck": 1.5, "boat": 1.2}
TRAILER_M = 0.45


class Kinematic:
    """A kinematic vehicle on a course, which stops on contact.

    Attributes:
        touches: Number of contacts so far.
    """

    def __init__(self, name: str, course: Course, pose: Pose) -> None:
        self.name = name
        self.pose = pose
        self.speed = 0.0
        self.yaw_rate = 0.0
        self.touches = 0
        self._touching = False
        self._obstacles = ClearanceField(course)
        self._current = course.current_mps
        self._steering = 0.0
        self._slide = 0.0
        self._trailer = pose.heading

    def advance(self, action: NDArray[np.float32], dt_s: float = 0.05) -> None:
        """Simulate one control period."""
        steering, throttle = float(action[0]), float(action[1])
        lag = 1.2 if self.name == "boat" else 0.15
        self.speed += (TOP[self.name] * throttle - self.speed) * dt_s / lag
        self._steering += (steering - self._steering) * min(1.0, dt_s / 0.08)
        vx = vy = 0.0
        if self.name in ("car", "truck"):
            wheelbase = 0.26 if self.name == "car" else 0.30
            angle = self._steering * math.radians(28.0)
            self.yaw_rate = -self.speed * math.tan(angle) / wheelbase
            self._slide = self.yaw_rate * wheelbase / 2  # The origin is the middle of the vehicle.
        elif self.name == "tank":
            rate = -steering * 2 * TOP["tank"] / 0.32
            self.yaw_rate += (rate - self.yaw_rate) * dt_s / 0.15
        else:
            rate = -1.3 * steering * self.speed
            self.yaw_rate += (rate - self.yaw_rate) * dt_s / 0.5
            # A hull slips towards the outside of a turn.
            self._slide += (-self.yaw_rate * self.speed * 0.4 - self._slide) * dt_s / 0.4
            vx, vy = self._current
        heading = self.pose.heading + self.yaw_rate * dt_s / 2
        vx += self.speed * math.cos(heading) - self._slide * math.sin(heading)
        vy += self.speed * math.sin(heading) + self._slide * math.cos(heading)
        moved = Pose(
            self.pose.x + vx * dt_s,
            self.pose.y + vy * dt_s,
            self.pose.heading + self.yaw_rate * dt_s,
        )
        trailer = self._trailer
        if self.name == "truck":
            bend = math.sin(self.pose.heading - trailer)
            trailer += self.speed * bend / TRAILER_M * dt_s
        touching = bool(self._obstacles.distance(self._hull(moved, trailer)).min() < 0.02)
        if touching:
            self.touches += not self._touching
            self.speed = self.yaw_rate = self._slide = 0.0
        else:
            self.pose, self._trailer = moved, trailer
        self._touching = touching

    def _hull(self, pose: Pose, trailer: float) -> NDArray[np.float64]:
        """Return points along the outline, m."""
        length, width = SIZES[self.name]
        points = [_outline(pose.x, pose.y, pose.heading, length, width)]
        if self.name == "truck":
            hitch_x = pose.x - 0.2 * math.cos(pose.heading)
            hitch_y = pose.y - 0.2 * math.sin(pose.heading)
            middle_x = hitch_x - 0.25 * math.cos(trailer)
            middle_y = hitch_y - 0.25 * math.sin(trailer)
            points.append(_outline(middle_x, middle_y, trailer, 0.5, width))
        return np.concatenate(points)


def _outline(
    x: float, y: float, heading: float, length: float, width: float
) -> NDArray[np.float64]:
    along = np.linspace(-length / 2, length / 2, round(length / 0.05) + 1)
    across = np.linspace(-width / 2, width / 2, round(width / 0.05) + 1)
    local = np.concatenate(
        [np.stack((along, np.full_like(along, side * width / 2)), axis=1) for side in (-1, 1)]
        + [np.stack((np.full_like(across, end * length / 2), across), axis=1) for end in (-1, 1)]
    )
    cos, sin = math.cos(heading), math.sin(heading)
    return local @ np.array(((cos, sin), (-sin, cos))) + (x, y)
