"""What the fields of a tub's record mean: see `tub`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

from shapechanger.demos.episodes import Step
from shapechanger.demos.exchange.tub_files import Record
from shapechanger.errors import DemosError
from shapechanger.layout import Feature, Layout

__all__ = ["ANGLE", "IMAGE", "MODE", "THROTTLE", "TUB_ACTIONS", "USER", "state_layout", "step_of"]

IMAGE: Final = "cam/image_array"
MODE: Final = "user/mode"
ANGLE: Final = "angle"
THROTTLE: Final = "throttle"
USER: Final = "user"
"""The mode in which a person drives."""

TUB_ACTIONS: Final = Layout(
    (Feature("steering", "1", -1.0, 1.0), Feature("throttle", "1", -1.0, 1.0))
)
"""What the numbers of an action mean."""

_ANGLE_BY_PILOT: Final = "local_angle"
_NUMBERS: Final = ("float", "int", "boolean")
_UNIT_UNKNOWN: Final = "?"


def state_layout(inputs: Mapping[str, str]) -> Layout | None:
    """The state in a tub with these inputs, by type; None where there is none."""
    names = [
        name
        for name, kind in inputs.items()
        if name and kind in _NUMBERS and not name.startswith(("user/", "pilot/", "_"))
    ]
    return Layout(tuple(Feature(name, _UNIT_UNKNOWN) for name in names)) if names else None


def step_of(record: Record, state: Layout | None) -> Step:
    """A record as a step.

    Raises:
        DemosError: If it does not say how the car was driven.
    """
    user = _pair(record, "user")
    if user is None:
        raise DemosError(f"{record.where} has no user/angle and user/throttle.")
    pilot = _pair(record, "pilot")
    mode = record.fields.get(MODE, USER)
    action = user
    if mode != USER and pilot is not None:
        action = (pilot[0], user[1]) if mode == _ANGLE_BY_PILOT else pilot
    return Step(
        action=action,
        driver="person" if mode == USER else "policy",
        wanted=pilot if mode == USER else None,
        state=tuple(_sensed(record.fields.get(name)) for name in state.names) if state else (),
        wall_ns=record.time_ns if record.is_unix else None,
    )


def _pair(record: Record, who: str) -> tuple[float, float] | None:
    """Angle and throttle; None where one of them is missing."""
    values = [record.fields.get(f"{who}/{what}") for what in (ANGLE, THROTTLE)]
    if None in values:
        return None
    for what, value in zip((ANGLE, THROTTLE), values, strict=True):
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= 1.0:
            raise DemosError(
                f"{record.where}: {who}/{what} is {value!r}, and it is a number from -1 to 1: mend "
                "or delete the record."
            )
    return float(values[0]), float(values[1])  # pyright: ignore[reportArgumentType]


def _sensed(value: Any) -> float:
    """A number that a sensor gave; NaN for none."""
    try:
        return float(value) if isinstance(value, bool | int | float) else math.nan
    except OverflowError:  # A whole number of hundreds of digits.
        return math.nan
