"""Start poses."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from shapechanger.vehicles.courses import WORLDS, lay_out, start_pose
from shapechanger.vehicles.courses.course import HELD_OUT, Obstacle
from shapechanger.vehicles.courses.geometry import distances_from_obstacle, wall_segments


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("seed", [0, 7, HELD_OUT[3]])
def test_starts_are_on_the_route_and_free(world: str, seed: int) -> None:
    """A truck with its trailer fits at each start, facing along the lane."""
    course = lay_out(world, seed)
    poses = {start_pose(course, k) for k in range(30)}
    assert len(poses) > 10
    assert poses == {start_pose(course, k) for k in range(30)}
    for pose in poses:
        far = np.hypot(course.route[:, 0] - pose.x, course.route[:, 1] - pose.y)
        i = int(far.argmin())
        assert far[i] == pytest.approx(0.0, abs=1e-9)
        step = course.route[(i + 1) % len(far)] - course.route[i]
        turned = math.atan2(step[1], step[0]) - pose.heading
        assert abs((turned + math.pi) % (2 * math.pi) - math.pi) < 0.1
        # One metre of vehicle and trailer, 0.24 m wide, from 0.3 m before the pose backwards.
        cos, sin = math.cos(pose.heading), math.sin(pose.heading)
        body = Obstacle(
            "box", pose.x - 0.25 * cos, pose.y - 0.25 * sin, pose.heading, 1.1, 0.24, 0.2
        )
        assert distances_from_obstacle(body, wall_segments(course.walls)).min() > 0.3
        ahead = course.route[np.arange(i, i + 20) % len(far)]
        pieces = np.concatenate([ahead[:-1], ahead[1:]], axis=1)
        assert all(
            distances_from_obstacle(obstacle, pieces).min() > 0.3 for obstacle in course.obstacles
        )


def test_a_full_lane_starts_at_its_first_point() -> None:
    course = lay_out("corridor", 0)
    full = replace(
        course,
        obstacles=tuple(Obstacle("bin", x, y, 0.0, 0.3, 0.3, 0.5) for x, y in course.route[::10]),
    )
    pose = start_pose(full, 3)
    assert (pose.x, pose.y) == tuple(course.route[0])
