"""A drive of a robot behind a link, judged by somebody who stands beside its twin."""

from __future__ import annotations

from typing import Any

from shapechanger.envs.vehicle.drive import LIMIT_S, METRES, Act, Drive
from shapechanger.remote.vehicle import RemoteVehicleEnv
from shapechanger.twin.operator import Operator

__all__ = ["Bystander", "drive_remote"]


class Bystander:
    """Brings the vehicle to the next start; what a remote env takes as `on_reset`.

    Args:
        operator: Who can do that.

    Attributes:
        operator: The same.
        course: Seed of the next course.
        start: Seed of the start on it.
    """

    def __init__(self, operator: Operator) -> None:
        self.operator = operator
        self.course = self.start = 0

    def __call__(self, seed: int | None) -> None:
        """Lay the course out; the env's seed says nothing here."""
        self.operator.lay_out(self.course)
        self.operator.place(self.start)


def drive_remote(
    env: RemoteVehicleEnv,
    bystander: Bystander,
    act: Act,
    *,
    course: int,
    start: int | None = None,
    metres: float = METRES,
    limit_s: float = LIMIT_S,
) -> Drive:
    """As `shapechanger.envs.vehicle.drive.drive`, on a twin that is served.

    Args:
        env: The robot, made with the bystander as `on_reset`; a collision ends no episode.
        bystander: Who puts it at the start, and back after a collision.
        act: Who drives.
        course: Seed of the course.
        start: Seed of the start on it; None for that of the course.
        metres: How far to drive, net along the course, m.
        limit_s: When to give up, s.

    Raises:
        RuntimeError: If the episode ends before.
    """
    bystander.course, bystander.start = course, course if start is None else start
    operator = bystander.operator
    seen: Any
    seen, _ = env.reset()
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
    return Drive(course, came, seconds, int(collisions), came >= metres)
