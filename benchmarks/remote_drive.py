"""Drive of a robot behind a link, scored by an operator of its twin."""

from __future__ import annotations

from typing import Any

from benchmarks.driving import LIMIT_S, METRES, Act, DriveResult
from shapechanger.robot.client.env import RemoteVehicleEnv
from shapechanger.robot.twin.robot import Operator
from shapechanger.vehicles.remote.waypoints import RemoteWaypointEnv


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
    """Drive a served twin along a course, like `benchmarks.driving.drive`.

    Args:
        env: The robot, made with `on_reset=operator.place`; a collision must not end the episode.
        operator: Operator that puts the robot at the start, and back after a collision.
        act: Driver.
        course: Seed of the course, which must be laid out already.
        start: Seed of the start on the course; None for the seed of the course.
        metres: Distance to drive, net along the course, m.
        limit_s: Time limit, s.

    Raises:
        RuntimeError: If the episode ends early.
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
