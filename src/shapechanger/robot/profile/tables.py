"""Tables of a profile with their keys, besides those of the chips."""

from __future__ import annotations

import datetime
from collections.abc import Mapping
from typing import Annotated, Final, Literal

from msgspec import Meta

from shapechanger.contract.plan import ActionPlan, LimitPlan, StopPlan
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.drivers.keys import FilePath, Keys, Text
from shapechanger.robot.drivers.pins import Pin
from shapechanger.robot.drivers.servos.settings import ServoBusKeys

DRIVING_PARTS: Final = (
    "wheels",
    "left track",
    "right track",
    "propeller",
    "left propeller",
    "right propeller",
)
"""Parts that propel the robot."""

Part = Literal[
    "",
    "wheels",
    "left track",
    "right track",
    "propeller",
    "left propeller",
    "right propeller",
    "steering",
    "rudder",
    "gear",
    "bed",
    "joint",
    "tendon",
]
"""Part that an output may move."""


class RobotKeys(Keys, frozen=True, kw_only=True):
    """Keys of `[robot]`; see `Profile`."""

    name: Text
    body: Text
    control_hz: Annotated[float, Meta(ge=1, le=100)] = 20.0
    calibrated: datetime.date | None = None
    turn_deg_per_m: Annotated[float, Meta(ge=0, le=10_000)] | None = None
    turn_deg_per_s: Annotated[float, Meta(ge=0, le=10_000)] | None = None


class OutputKeys(Keys, frozen=True, kw_only=True):
    """Keys of every output; see `OutputPlan`."""

    driver: str
    part: Part = ""
    mix: dict[str, Annotated[float, Meta(ge=-10, le=10)]]
    offset: Annotated[float, Meta(ge=-1, le=1)] = 0.0


class SensorKeys(Keys, frozen=True, kw_only=True):
    """Key of every sensor."""

    driver: str


class CommandKeys(Keys, frozen=True, kw_only=True):
    """Keys of `[limits]` that concern clients and their commands; see `Profile`."""

    max_observation_age_ms: Annotated[int, Meta(ge=20, le=5000)] = 400
    arming: Literal["person", "anyone"] = "person"


class RewardKeys(Keys, frozen=True, kw_only=True):
    """Keys of `[reward]`; see `Profile.reward`."""

    velocity: Annotated[float, Meta(ge=0, le=1e6)] = 1.0
    collision: Annotated[float, Meta(ge=-1e6, le=0)] = -10.0
    stall: Annotated[float, Meta(ge=-1e6, le=0)] = -1.0
    collision_ends_episode: bool = True


class ResetKeys(Keys, frozen=True, kw_only=True):
    """Keys of a step of the reset routine; see `ResetStep`."""

    values: dict[str, Annotated[float, Meta(ge=-1, le=1)]]
    seconds: Annotated[float, Meta(gt=0, le=60)]


class EnableKeys(Keys, frozen=True, kw_only=True):
    """Keys of `[enable]`.

    Attributes:
        pin: Pin that the guard toggles.
        hold_ms: How long the one-shot holds the line after an edge. The guard toggles the pin at
            each tick, every 10 ms, and may be a few ms late.
    """

    pin: Pin
    hold_ms: Annotated[int, Meta(ge=30, le=1000)] = 100


class EmergencyButtonKeys(Keys, frozen=True, kw_only=True):
    """Key of `[emergency_button]`: pin of a button to ground."""

    pin: Pin


class _NumberKeys(Keys, frozen=True, kw_only=True):
    number: Annotated[int, Meta(ge=0, le=9)] = 0


class _DeviceKeys(Keys, frozen=True, kw_only=True):
    device: FilePath = "/dev/video0"


class _PathKeys(Keys, frozen=True, kw_only=True):
    path: FilePath


CAMERAS: Final[Mapping[str, type[Keys]]] = {
    "picamera2": _NumberKeys,
    "v4l2": _DeviceKeys,
    "file": _PathKeys,
    "pipe": _PathKeys,
    "pattern": Keys,
}
"""Keys of each camera driver."""

TABLES: Final[Mapping[str, tuple[type, ...]]] = {
    "robot": (RobotKeys,),
    "action": (ActionPlan,),
    "output": (OutputKeys,),
    "sensor": (SensorKeys,),
    "camera": (CameraPlan,),
    "limits": (LimitPlan, CommandKeys),
    "stop": (StopPlan,),
    "reward": (RewardKeys,),
    "reset": (ResetKeys,),
    "enable": (EnableKeys,),
    "emergency_button": (EmergencyButtonKeys,),
    "servo_bus": (ServoBusKeys,),
}
"""Tables of a profile, with their keys; `action`, `output` and `sensor` hold one table per name."""
