"""A drive of a robot behind a link, judged by somebody who stands beside its twin."""

from __future__ import annotations

from typing import Any

from shapechanger.envs.remote.vehicle import RemoteVehicleEnv
from shapechanger.envs.remote.waypoints import RemoteWaypointEnv
from shapechanger.envs.vehicle.evaluation import LIMIT_S, METRES, Act, DriveResult
from shapechanger.twin.robot import Operator


def drive_remote(
    env: RemoteVehicleEnv | RemoteWaypointEnv,
    operator: Operator,
    act: Act,
    *,
    course: int,
    start: int | None = None,
    metres: float = METRES,
    limit_s: float = LIMIT_S,
) -> DriveResult:
    """As `shapechanger.envs.vehicle.evaluation.drive`, on a twin that is served.

    Args:
        env: The robot, made with `on_reset=operator.place`; a collision ends no episode.
        operator: Who puts it at the start, and back after a collision.
        act: Who drives.
        course: Seed of the course, which is laid out already.
        start: Seed of the start on it; None for that of the course.
        metres: How far to drive, net along the course, m.
        limit_s: When to give up, s.

    Raises:
        RuntimeError: If the episode ends before.
    """
    seen: Any
    seen, _ = env.reset(seed=course if start is None else start)
    where = operator.where()
    began_ns, collisions = where.t, where.truth["collisions"]
    while where.truth["progress_m"] < metres and where.t - began_ns < 1e9 * limit_s:
        seen, _, terminated, truncated, info = env.step(act(seen))
        if terminated or truncated:
            raise RuntimeError(f"The drive ended: {info.get('truncated_because')}")
        where = operator.where()
        if where.truth["collisions"] > collisions:
            collisions = where.truth["collisions"]
            operator.put_back()
    came = where.truth["progress_m"]
    seconds = (where.t - began_ns) / 1e9
    return DriveResult(course, came, seconds, int(collisions), came >= metres)
