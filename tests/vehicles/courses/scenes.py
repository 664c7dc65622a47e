"""A small course for tests."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from shapechanger.vehicles.courses.course import Course, Lamp, Obstacle, Surface, Wall
from shapechanger.vehicles.courses.geometry import resample

_KINDS: dict[str, tuple[Surface, ...]] = {
    "corridor": ("plaster", "door", "window", "brick", "board", "glass"),
    "yard": ("hedge", "fence", "shed"),
    "harbour": ("quay", "rock"),
}


def square(world: str) -> Course:
    """Return a loop around a block of 4 m; the lane is 2 m wide, x and y from -1 to 7 m."""
    route = resample(np.array([(0.0, 0.0), (6.0, 0.0), (6.0, 6.0), (0.0, 6.0)]), 0.1)
    outer = [(-1.0, -1.0), (7.0, -1.0), (7.0, 7.0), (-1.0, 7.0)]
    inner = [(1.0, 1.0), (1.0, 5.0), (5.0, 5.0), (5.0, 1.0)]
    kinds = _KINDS[world]
    indoors = world == "corridor"
    walls = tuple(
        Wall(loop[i], loop[(i + 1) % 4], 2.4 if indoors else 0.8, kinds[(i + k) % len(kinds)])
        for k, loop in enumerate((outer, inner))
        for i in range(4)
    )
    return Course(
        world=world,
        seed=7,
        route=route,
        half_width=np.ones(len(route)),
        walls=walls,
        obstacles=(
            Obstacle("bench", 3.0, 0.6, 0.0, 1.2, 0.4, 0.45),
            Obstacle("bin", 6.6, 3.0, 0.3, 0.3, 0.3, 0.6),
        ),
        lamps=(Lamp(5.0, 0.0, 0.5 * np.pi, 1.2, 0.3),) if indoors else (),
        ceiling_m=2.4 if indoors else 0.0,
        gap_m=1.0,
    )


def with_walls(course: Course, *walls: Wall) -> Course:
    """Return the course with other walls, and without obstacles and lamps."""
    return replace(course, walls=walls, obstacles=(), lamps=())


def in_lane(course: Course, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which points, m, (n, 2), are in the lane: their rays cross an odd number of walls."""
    starts = np.array([wall.start for wall in course.walls])
    ends = np.array([wall.end for wall in course.walls])
    x, y = points[:, None, 0], points[:, None, 1]
    (x0, y0), (x1, y1) = starts.T, ends.T
    spans = (y0 > y) != (y1 > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = x0 + (y - y0) / (y1 - y0) * (x1 - x0)
    return (spans & (at > x)).sum(axis=1) % 2 == 1
