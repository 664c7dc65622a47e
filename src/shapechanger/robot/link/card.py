"""Card of a robot: the facts that its processes, its clients and its recordings share."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, Literal

import msgspec
from msgspec import Meta

if TYPE_CHECKING:  # Clients need no profile.
    from shapechanger.robot.profile.profile import Profile


class RobotCard(msgspec.Struct, frozen=True, kw_only=True):
    """Facts of a robot, made once from its profile by `card_of`.

    Attributes:
        robot: Name of the robot.
        body: Kind of robot, such as "car".
        action_layout: JSON of the `Layout` of `Command.values`.
        state_layout: JSON of the `Layout` of `Observation.state`. A feature has the value of the
            guard's quantity of the same name, or of the applied action NAME for "NAME/applied"; NaN
            if it is not measured.
        image_size: Width and height of the frames, pixels; None without a camera.
        camera_pitch_deg: Angle of the camera's optical axis below the horizon, degrees; None if the
            profile does not state it.
        camera_fovy_deg: Vertical field of view of the camera, degrees; None if unknown.
        control_hz: Commands per second that the robot expects.
        tick_hz: Rate of the guard, Hz.
        slew_per_s: Fastest change of each action away from rest, 1/s; 0 for no limit.
        slew_down_per_s: Fastest change of each action towards rest, 1/s; 0 for no limit.
        deadline_ms: Longest time that a command acts, ms; the guard enforces it.
        max_observation_age_ms: Largest age of the observation that a command answers, ms.
        reward: Weights of the reward, keyed by name.
        reset: Commands that return the robot to the start: values and duration, s, of each; empty
            for none.
        arming: Who may arm the robot.
        clock: Source of the robot's time.
        turning: Turn at full steering, rad/m and rad/s; 0 if one is not measured, None if neither.
    """

    robot: Annotated[str, Meta(min_length=1, max_length=64)]
    body: str
    action_layout: str
    state_layout: str
    image_size: tuple[int, int] | None
    control_hz: Annotated[float, Meta(gt=0.0, le=100_000.0)]
    deadline_ms: Annotated[int, Meta(ge=1)]
    max_observation_age_ms: Annotated[int, Meta(ge=1)]
    reward: dict[str, float]
    reset: tuple[tuple[tuple[float, ...], float], ...]
    arming: Literal["person", "anyone"]
    clock: Literal["real", "twin"]
    tick_hz: Annotated[float, Meta(gt=0.0)] = 100.0
    slew_per_s: tuple[float, ...] = ()
    slew_down_per_s: tuple[float, ...] = ()
    camera_pitch_deg: float | None = None
    camera_fovy_deg: float | None = None
    turning: tuple[float, float] | None = None

    @property
    def camera_deg(self) -> tuple[float | None, float | None]:
        """Pitch and vertical field of view of the camera, degrees, as far as they are known."""
        return self.camera_pitch_deg, self.camera_fovy_deg


def card_of(
    profile: Profile,
    *,
    arming: Literal["", "anyone"] = "",
    clock: Literal["real", "twin"] = "real",
    pictures: bool = True,
) -> RobotCard:
    """Return the card of a robot.

    Args:
        profile: Profile of the robot.
        arming: Who may arm the robot; "" for the setting of the profile.
        clock: Source of the robot's time.
        pictures: Whether the robot's camera is used.
    """
    camera = profile.camera if pictures else None
    same = {n: getattr(profile, n) for n in RobotCard.__struct_fields__ if hasattr(profile, n)}
    others: dict[str, Any] = {
        "robot": profile.name,
        "action_layout": profile.action_layout().to_json(),
        "state_layout": profile.state_layout().to_json(),
        "image_size": None if camera is None else camera.size,
        "camera_pitch_deg": None if camera is None else camera.pitch_deg,
        "camera_fovy_deg": None if camera is None else camera.fovy_deg,
        "slew_per_s": tuple(_limit(action.slew_per_s) for action in profile.actions),
        "slew_down_per_s": tuple(_limit(action.slew_down_per_s) for action in profile.actions),
        "deadline_ms": profile.limits.deadline_ms,
        "arming": arming or profile.arming,
        "clock": clock,
    }
    return RobotCard(**same | others)


def _limit(slew_per_s: float) -> float:
    """Return a slew for JSON, which has no infinity: 0 for no limit."""
    return slew_per_s if math.isfinite(slew_per_s) else 0.0
