"""What was recorded: the file `episode.json`."""

from __future__ import annotations

import binascii
import json
import math
from dataclasses import asdict, dataclass, field, fields
from typing import Any, Final, Literal, cast

from shapechanger.errors import DemosError

__all__ = [
    "DRIVERS",
    "FORMAT",
    "MAX_LINE",
    "Clock",
    "Driver",
    "EpisodeHeader",
    "Step",
    "decode_line",
    "encode_line",
    "split_lines",
]

FORMAT: Final = 1
"""Version of the format; a reader refuses another one."""

Clock = Literal["real", "twin", "none"]
"""Where the nanoseconds of the steps come from: a robot's clock, that of a twin whose time moves in
steps, or nowhere."""

_CLOCKS: Final = ("real", "twin", "none")
_IMAGE_SIZE: Final = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class EpisodeHeader:
    """What an episode is of.

    Attributes:
        action_layout: JSON of the `Layout` of the actions.
        state_layout: JSON of the `Layout` of the states; "" without states.
        image_size: Width and height of the pictures in pixels; None without pictures.
        control_hz: Steps a second.
        robot: Name of the robot.
        body: What it is, such as "car".
        env: Id of the env; "" for a robot that was driven without one.
        env_kwargs: Its arguments, as JSON can hold them.
        driver: Who drives, for people to read.
        clock: Where the nanoseconds of the steps come from.
        seed: Seed of the first reset; None for none.
        source: What made it: a command, or the format it was imported from.
        notes: More, for people to read, as JSON can hold it.
        created: When it began, ISO 8601 in UTC; the writer fills it in.
        version: Version of Shapechanger that wrote it; the writer fills it in.
        format: Version of the format.

    Raises:
        DemosError: If it contradicts itself.
    """

    action_layout: str
    state_layout: str = ""
    image_size: tuple[int, int] | None = None
    control_hz: float = 20.0
    robot: str = ""
    body: str = ""
    env: str = ""
    env_kwargs: dict[str, Any] = field(default_factory=dict[str, Any])
    driver: str = ""
    clock: Clock = "real"
    seed: int | None = None
    source: str = ""
    notes: dict[str, Any] = field(default_factory=dict[str, Any])
    created: str = ""
    version: str = ""
    format: int = FORMAT

    def __post_init__(self) -> None:
        if not (self.control_hz > 0.0 and math.isfinite(self.control_hz)):
            raise DemosError(f"An episode has steps at more than 0 Hz, got {self.control_hz}.")
        if self.clock not in _CLOCKS:
            raise DemosError(f"The clock is one of {', '.join(_CLOCKS)}, got {self.clock!r}.")
        if self.image_size is not None and (
            len(self.image_size) != _IMAGE_SIZE or min(self.image_size) < 1
        ):
            raise DemosError(f"Pictures cannot have a size of {self.image_size}.")
        if self.action_size < 1:
            raise DemosError("An action has at least one number.")
        _ = self.state_size

    @property
    def action_size(self) -> int:
        """How many numbers an action has."""
        return _layout_size(self.action_layout)

    @property
    def state_size(self) -> int:
        """How many numbers a state has."""
        return _layout_size(self.state_layout) if self.state_layout else 0

    def to_json(self) -> dict[str, Any]:
        """The header as JSON can hold it, with the layouts spelled out for people to read."""
        plain = asdict(self)
        for name in ("action_layout", "state_layout"):
            plain[name] = json.loads(plain[name]) if plain[name] else None
        plain["image_size"] = None if self.image_size is None else list(self.image_size)
        return plain

    @classmethod
    def from_json(cls, plain: dict[str, Any]) -> EpisodeHeader:
        """Read what `to_json` gave; what is not known is left out.

        Raises:
            DemosError: If it is no header.
        """
        if plain.get("format") != FORMAT:
            raise DemosError(
                f"the episode has format {plain.get('format')}, and this version of Shapechanger "
                f"reads format {FORMAT}."
            )
        known = {name: plain[name] for name in (f.name for f in fields(cls)) if name in plain}
        try:
            for name in ("action_layout", "state_layout"):
                known[name] = _compact(known[name])
            if known.get("image_size") is not None:
                width, height = known["image_size"]
                known["image_size"] = (int(width), int(height))
            return cls(**known)
        except (KeyError, TypeError, ValueError) as error:
            raise DemosError(f"the header is not whole ({error}).") from error


def _compact(layout: dict[str, Any] | None) -> str:
    """A layout as `Layout.to_json` writes it; "" for none."""
    return json.dumps(layout, separators=(",", ":"), ensure_ascii=False) if layout else ""


def _layout_size(layout: str) -> int:
    """How many numbers a layout has, without what reading layouts loads."""
    try:
        features = cast("list[dict[str, Any]]", json.loads(layout)["features"])
        return sum(math.prod(feature.get("shape", ())) for feature in features)
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        raise DemosError(f"This is no layout: {layout[:80]!r}.") from error


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


MAX_LINE: Final = 1 << 20
"""Bytes of the longest line; a longer one is no step."""

_CHECK: Final = b',"crc":"%08x"}\n'
_CHECK_SIZE: Final = len(_CHECK % 0)


def encode_line(fields: dict[str, Any]) -> bytes:
    """One line, with the CRC-32 of everything before it as its last key.

    Args:
        fields: Values that JSON can hold, at least one.
    """
    text = json.dumps(fields, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    # Half of a surrogate pair has no bytes.
    body = text.encode(errors="replace")[:-1]
    return body + _CHECK % binascii.crc32(body)


def decode_line(line: bytes) -> dict[str, Any]:
    r"""What `encode_line` was given.

    Args:
        line: One line, with its `\n`.

    Raises:
        ValueError: If it is not whole, and why.
    """
    if len(line) > MAX_LINE:
        raise ValueError(f"it has {len(line)} bytes")
    body, check = line[:-_CHECK_SIZE], line[-_CHECK_SIZE:]
    if not body or check != _CHECK % binascii.crc32(body):
        raise ValueError("it is cut off or was changed")
    fields = json.loads(body + b"}")
    if not isinstance(fields, dict):
        raise ValueError("it is no JSON object")
    return cast("dict[str, Any]", fields)


def split_lines(content: bytes) -> list[bytes]:
    r"""The lines of a file, each with its `\n`; only the last one may lack it."""
    return content.splitlines(keepends=True) if b"\r" not in content else _by_newline(content)


def _by_newline(content: bytes) -> list[bytes]:
    r"""Like `splitlines`, which would also split at a `\r` that damage has put there."""
    lines = [line + b"\n" for line in content.split(b"\n")]
    last = lines.pop()[:-1]
    return [*lines, last] if last else lines
