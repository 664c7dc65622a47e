"""Hand-made courses with known walls and obstacles."""

import numpy as np

from shapechanger.vehicles.courses.course import Course, Obstacle, Wall


def ring(
    seed: int,
    *,
    half_width: float = 1.0,
    radius: float = 8.0,
    obstacles: int = 10,
    gap: float = 0.9,
    current: tuple[float, float] = (0.0, 0.0),
) -> Course:
    """Return a wavy ring with boxes and posts on both sides that leave a gap of at least `gap`."""
    rng = np.random.default_rng(seed)
    turns = np.linspace(0.0, 2 * np.pi, 400, endpoint=False)
    phases = rng.uniform(0, 2 * np.pi, 2)
    far = radius * (1 + 0.12 * np.cos(2 * turns + phases[0]) + 0.08 * np.cos(3 * turns + phases[1]))
    route = np.stack((far * np.cos(turns), far * np.sin(turns)), axis=1)
    for _ in range(3):  # Even spacing.
        closed = np.vstack((route, route[:1]))
        stations = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(closed, axis=0).T))))
        even = np.linspace(0.0, stations[-1], 400, endpoint=False)
        route = np.stack([np.interp(even, stations, closed[:, j]) for j in (0, 1)], axis=1)
    ahead = np.roll(route, -1, axis=0) - np.roll(route, 1, axis=0)
    ahead /= np.linalg.norm(ahead, axis=1)[:, None]
    left = np.stack((-ahead[:, 1], ahead[:, 0]), axis=1)
    walls: list[Wall] = []
    for side in (1, -1):
        edge = (route + side * half_width * left)[::4][::-side]
        walls += [
            Wall((float(a[0]), float(a[1])), (float(b[0]), float(b[1])), 0.5, "plaster")
            for a, b in zip(edge, np.roll(edge, -1, axis=0), strict=True)
        ]
    stand: list[Obstacle] = []
    for n in range(obstacles):
        i = int((n + rng.uniform(0.2, 0.8)) * len(route) / obstacles)
        size = float(rng.uniform(0.25, 0.5))
        reach = float(rng.uniform(0.3, 2 * half_width - gap - 0.1))
        side = rng.choice((-1, 1))
        x, y = route[i] + side * (half_width - reach + size / 2) * left[i]
        yaw = float(np.arctan2(ahead[i, 1], ahead[i, 0]))
        kind = "box" if rng.random() < 0.5 else "post"
        stand.append(Obstacle(kind, float(x), float(y), yaw, size, size, 0.4))
    return Course(
        world="corridor",
        seed=seed,
        route=route,
        half_width=np.full(len(route), half_width),
        walls=tuple(walls),
        obstacles=tuple(stand),
        lamps=(),
        ceiling_m=0.0,
        gap_m=gap,
        current_mps=current,
    )
