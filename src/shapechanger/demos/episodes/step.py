"""One step: what was seen, what was decided on seeing it, and what was done."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Final, Literal, cast

__all__ = ["DRIVERS", "Driver", "Step"]

Driver = Literal["person", "policy", "expert", "program"]
"""Who decides: a person; a learned policy; an expert that knows the world; any other program."""

DRIVERS: Final[tuple[Driver, ...]] = ("person", "policy", "expert", "program")

_INFINITIES: Final = {math.inf: "inf", -math.inf: "-inf"}
_NS: Final = ("captured_ns", "decided_ns", "wall_ns")


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """One step of an episode.

    Attributes:
        action: What was decided on seeing this step's picture and state, in the order and units of
            the action layout.
        driver: Who decided it.
        applied: What the outputs did then, after caps, slew and reflexes; None where nobody knows.
        wanted: What a policy wanted to do while somebody else drove; None for nothing.
        state: The numbers of the state layout; NaN where nothing measures one.
        captured_ns: When the picture was taken, or the state read; monotonic clock of the robot.
        decided_ns: When the action reached the robot; same clock.
        wall_ns: When the step was recorded; Unix time of whoever recorded it.
        reward: What the step was worth.
        terms: The terms of that by name.
        terminated: Whether the task was over then.
        truncated: Whether the episode was cut off then.
        stop_reason: Why the robot did not do what it was told, in words; empty when it did.
        index: Its number in the episode, from 0; -1 before it is written.
        frame: File name of its picture; "" for none.
        frame_bytes: Size of that file.
        frame_crc: CRC-32 of that file.
    """

    action: tuple[float, ...]
    driver: Driver
    applied: tuple[float, ...] | None = None
    wanted: tuple[float, ...] | None = None
    state: tuple[float, ...] = ()
    captured_ns: int | None = None
    decided_ns: int | None = None
    wall_ns: int | None = None
    reward: float | None = None
    terms: dict[str, float] = field(default_factory=dict[str, float])
    terminated: bool = False
    truncated: bool = False
    stop_reason: str = ""
    index: int = -1
    frame: str = ""
    frame_bytes: int = 0
    frame_crc: int = 0

    def refusal(self, action_size: int, state_size: int) -> str:
        """What is wrong with it, in words; empty for nothing.

        Args:
            action_size: How many numbers an action has.
            state_size: How many numbers a state has.
        """
        for name, size in (("action", action_size), ("applied", action_size)):
            values = getattr(self, name)
            if values is not None and len(values) != size:
                return f"its {name} has {len(values)} numbers, and the layout has {size}"
        if self.wanted is not None and len(self.wanted) != action_size:
            return f"its wanted has {len(self.wanted)} numbers, and the layout has {action_size}"
        if len(self.state) != state_size:
            return f"its state has {len(self.state)} numbers, and the layout has {state_size}"
        if not all(math.isfinite(value) for value in self.action):
            return f"its action is {list(self.action)}"
        if self.driver not in DRIVERS:
            return f"its driver is {self.driver!r}, and not one of {', '.join(DRIVERS)}"
        return ""

    def to_json(self) -> dict[str, Any]:
        """The step as JSON can hold it; what is nothing is left out."""
        plain: dict[str, Any] = {"kind": "step", "step": self.index, "driver": self.driver}
        plain["action"] = _written(self.action)
        for name in ("applied", "wanted"):
            values = getattr(self, name)
            if values is not None:
                plain[name] = _written(values)
        if self.state:
            plain["state"] = _written(self.state)
        for name in _NS:
            if getattr(self, name) is not None:
                plain[name] = getattr(self, name)
        if self.reward is not None:
            plain["reward"] = _written((self.reward,))[0]
        if self.terms:
            plain["terms"] = dict(zip(self.terms, _written(self.terms.values()), strict=True))
        for name in ("terminated", "truncated", "stop_reason"):
            if getattr(self, name):
                plain[name] = getattr(self, name)
        if self.frame:
            plain["frame"] = [self.frame, self.frame_bytes, f"{self.frame_crc:08x}"]
        return plain

    @classmethod
    def from_json(cls, plain: dict[str, Any]) -> Step:
        """Read what `to_json` gave.

        Raises:
            ValueError: If it is no step.
        """
        try:
            frame, size, crc = plain.get("frame", ("", 0, "0"))
            terms = cast("dict[str, Any]", plain.get("terms", {}))
            reward = plain.get("reward", ...)
            return cls(
                action=_read(plain["action"]),
                driver=plain["driver"],
                applied=_read(plain["applied"]) if "applied" in plain else None,
                wanted=_read(plain["wanted"]) if "wanted" in plain else None,
                state=_read(plain.get("state", ())),
                **{name: int(plain[name]) for name in _NS if name in plain},
                reward=None if reward is ... else _read((reward,))[0],
                terms=dict(zip(terms, _read(terms.values()), strict=True)),
                terminated=bool(plain.get("terminated", False)),
                truncated=bool(plain.get("truncated", False)),
                stop_reason=str(plain.get("stop_reason", "")),
                index=int(plain["step"]),
                frame=str(frame),
                frame_bytes=int(size),
                frame_crc=int(crc, 16),
            )
        except (LookupError, TypeError, AttributeError) as error:
            raise ValueError(f"it is no step ({error})") from error


def _written(values: Any) -> list[float | str | None]:
    """Numbers as JSON can hold them: nothing for NaN, words for the infinite ones."""
    return [None if math.isnan(value) else _INFINITIES.get(value, float(value)) for value in values]


def _read(values: Any) -> tuple[float, ...]:
    return tuple(math.nan if value is None else float(value) for value in values)
