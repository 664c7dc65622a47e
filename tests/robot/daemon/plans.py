"""Plan, frames and guard states of a car, for the tests of the daemon."""

from typing import Any

import msgspec
import numpy as np
import simplejpeg

from shapechanger.layout import Feature, Layout
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.daemon.plan import DaemonPlan
from shapechanger.robot.guard.channel import NO_STATE, GuardState
from shapechanger.robot.link.card import RobotCard

SIZE = (160, 120)
ACTIONS = Layout((Feature("steering", "1", -1.0, 1.0), Feature("throttle", "1", -1.0, 1.0)))
STATE = Layout(
    (Feature("speed", "m/s"), Feature("distance", "m"), Feature("throttle/applied", "1"))
)


def car_plan(**changes: Any) -> DaemonPlan:
    """Return the plan of a car with a camera, served on loopback without TLS."""
    fields: dict[str, Any] = {
        "robot": "test car",
        "body": "car",
        "action_layout": ACTIONS.to_json(),
        "state_layout": STATE.to_json(),
        "image_size": SIZE,
        "control_hz": 20.0,
        "deadline_ms": 250,
        "max_observation_age_ms": 400,
        "reward": {},
        "reset": (),
        "arming": "person",
        "clock": "real",
        "camera_pitch_deg": 3.0,
        "camera_fovy_deg": 48.8,
        "camera": CameraPlan("pattern", SIZE, pitch_deg=3.0, fovy_deg=48.8),
        "port": 0,
        "discovery": False,
    } | changes
    facts = {name: fields.pop(name) for name in RobotCard.__struct_fields__ if name in fields}
    return DaemonPlan(card=RobotCard(**facts), **fields)


def picture(number: int, size: tuple[int, int] = SIZE) -> bytes:
    rng = np.random.default_rng(number)
    # The image has coarse blocks, because noise does not compress.
    coarse = rng.integers(0, 256, (size[1] // 8, size[0] // 8, 3), dtype=np.uint8)
    return simplejpeg.encode_jpeg(coarse.repeat(8, 0).repeat(8, 1), quality=80)


def guard_state(**changes: Any) -> GuardState:
    fields: dict[str, Any] = {
        "stop_reason": "Not armed.",
        "applied": (0.0, 0.0),
        "quantities": {"speed": 0.25},
        "sources": {"speed": "wheel"},
    }
    return msgspec.structs.replace(NO_STATE, **(fields | changes))
