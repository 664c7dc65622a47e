"""Records of an episode: the header in `episode.json` and the steps in `steps.jsonl`."""

from __future__ import annotations

import binascii
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from itertools import pairwise
from typing import Annotated, Any, Final, Literal, cast

import msgspec
from msgspec import Meta

from shapechanger.demos.episodes.files import MAX_PICTURE_BYTES
from shapechanger.errors import DemosError, translate_errors
from shapechanger.layout import Layout

_FORMAT: Final = 1
"""Version of the format. Readers refuse any other version."""

Clock = Literal["real", "twin", "none"]
"""Source of the nanoseconds in steps: a robot's clock, the stepped clock of a twin, or none."""

_Pixels = Annotated[int, Meta(ge=1)]
# A stack of four grey images of 84 x 84, as state, is 28 224 values.
_MAX_VALUES: Final = 1 << 17
_MAX_INTEGER: Final = 1 << 62  # Sums of two fit into the 64 bits of NumPy and of other formats.


@dataclass(frozen=True, slots=True, kw_only=True)
class EpisodeHeader:
    """Metadata of an episode.

    Attributes:
        action_layout: JSON of the `Layout` of the actions.
        state_layout: JSON of the `Layout` of the states; "" without states.
        image_size: Width and height of the images in pixels; None without images.
        control_hz: Steps per second.
        robot: Name of the robot.
        body: Kind of robot, such as "car".
        camera_pitch_deg: Angle of the camera's optical axis below the horizon, degrees; None if
            unknown.
        camera_fovy_deg: Vertical field of view of the camera, degrees; None if unknown.
        env: Id of the env; "" for a robot that was driven without one.
        env_kwargs: Arguments of the env, as JSON can hold them.
        driver: Free text for people to read: who drove.
        clock: Source of the nanoseconds in the steps.
        seed: Seed of the first reset; None if unseeded.
        source: The command that recorded the episode, or the format it was imported from.
        notes: Further metadata for people to read, as JSON can hold it.
        created: Start time, ISO 8601 in UTC; set by the writer.
        version: Version of Shapechanger that wrote the episode; set by the writer.
        format: Version of the format.

    Raises:
        DemosError: If a layout has no action, or too many values.
        LayoutError: If a layout is invalid.
    """

    action_layout: str
    state_layout: str = ""
    image_size: tuple[_Pixels, _Pixels] | None = None
    control_hz: Annotated[float, Meta(ge=1e-3, le=1e6)] = 20.0
    robot: str = ""
    body: str = ""
    camera_pitch_deg: float | None = None
    camera_fovy_deg: float | None = None
    env: str = ""
    env_kwargs: dict[str, Any] = field(default_factory=dict[str, Any])
    driver: str = ""
    clock: Clock = "real"
    seed: int | None = None
    source: str = ""
    notes: dict[str, Any] = field(default_factory=dict[str, Any])
    created: str = ""
    version: str = ""
    format: int = _FORMAT

    def __post_init__(self) -> None:
        # A few bytes can describe more values than any memory holds.
        if not (1 <= self.action_size <= _MAX_VALUES and 0 <= self.state_size <= _MAX_VALUES):
            raise DemosError(
                "action_layout must have at least one value, and each layout at most "
                f"{_MAX_VALUES}."
            )

    @property
    def action_size(self) -> int:
        """Number of values in an action."""
        return Layout.from_json(self.action_layout).size

    @property
    def state_size(self) -> int:
        """Number of values in a state; 0 without states."""
        return Layout.from_json(self.state_layout).size if self.state_layout else 0

    def to_json(self) -> dict[str, Any]:
        """Return the header as JSON can hold it, with the layouts expanded for readability."""
        plain = asdict(self)
        for name in ("action_layout", "state_layout"):
            plain[name] = json.loads(plain[name]) if plain[name] else None
        return plain

    @classmethod
    def from_json(cls, plain: dict[str, Any]) -> EpisodeHeader:
        """Parse the output of `to_json`; unknown keys are ignored.

        Raises:
            DemosError: If a field is missing or invalid, or the format has another version.
        """
        if plain.get("format") != _FORMAT:
            raise DemosError(
                f"The episode has format {plain.get('format')}, but this version of Shapechanger "
                f"reads format {_FORMAT} only."
            )
        known = dict(plain)
        for name in ("action_layout", "state_layout"):
            if name in plain:  # As `Layout.to_json` writes it; null is "".
                layout = plain[name] or ""
                known[name] = layout and json.dumps(
                    layout, separators=(",", ":"), ensure_ascii=False
                )
        with translate_errors(
            msgspec.ValidationError,
            to=lambda error: DemosError(f"The header is invalid ({error})."),
        ):
            return msgspec.convert(known, cls)


Driver = Literal["person", "policy", "expert", "program"]
"""Kinds of drivers: a person, a learned policy, an expert with full state, or a program."""

DRIVERS: Final[tuple[Driver, ...]] = ("person", "policy", "expert", "program")

_NS: Final = ("captured_ns", "decided_ns", "wall_ns")


class StepPicture(msgspec.Struct, frozen=True, array_like=True):
    """The image of a step: file name, size in bytes, and CRC-32 as eight hexadecimal digits."""

    name: Annotated[str, Meta(pattern=r"^[0-9]{6,}\.jpg\Z")]  # It never leads to another folder.
    size: Annotated[int, Meta(le=MAX_PICTURE_BYTES)]
    crc: str

    @classmethod
    def of(cls, name: str, jpeg: bytes) -> StepPicture:
        """Return the record of an image."""
        return cls(name, len(jpeg), f"{binascii.crc32(jpeg):08x}")

    def fits(self, jpeg: bytes) -> bool:
        """Return whether an image is the recorded one."""
        return self == StepPicture.of(self.name, jpeg)


class Step(
    msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True, tag_field="kind", tag="step"
):
    """One step of an episode.

    Attributes:
        index: Position in the episode, from 0; -1 before the step is written.
        driver: Who decided the action.
        action: The action decided for this step's observation, in the order and units of the action
            layout.
        applied: What the outputs did, after caps, slew limits and reflexes; None if unknown.
        wanted: What a policy would have done while somebody else drove; None without a policy.
        state: Values of the state layout; NaN where nothing measured one.
        captured_ns: When the image was taken or the state was read; monotonic clock of the robot.
        decided_ns: When the action reached the robot; same clock.
        wall_ns: When the step was recorded; Unix time of the recorder.
        reward: Reward of the step; None without a reward.
        terms: Terms of the reward, by name.
        terminated: Whether the task ended with this step.
        truncated: Whether the episode was cut short at this step.
        stop_reason: Why the robot overrode the action; "" if it did not.
        picture: Its image on disk; None for none.
    """

    index: int = msgspec.field(default=-1, name="step")
    driver: Driver
    action: tuple[float, ...]
    applied: tuple[float, ...] | None = None
    wanted: tuple[float, ...] | None = None
    state: tuple[float, ...] = ()
    captured_ns: int | None = None
    decided_ns: int | None = None
    wall_ns: int | None = None
    reward: float | None = None
    terms: dict[str, float] = {}
    terminated: bool = False
    truncated: bool = False
    stop_reason: str = ""
    picture: StepPicture | None = msgspec.field(default=None, name="frame")

    @property
    def frame(self) -> str:
        """File name of the image; "" for none."""
        return "" if self.picture is None else self.picture.name

    @property
    def clock_ns(self) -> int | None:
        """Time on the robot's clock: of the capture, or else of the decision; None if unknown."""
        return self.decided_ns if self.captured_ns is None else self.captured_ns

    def refusal(self, action_size: int, state_size: int) -> str:
        """Return why the step is invalid, as part of a sentence; "" if it is valid.

        Args:
            action_size: Number of values in an action.
            state_size: Number of values in a state.
        """
        for name, size in (
            ("action", action_size),
            ("applied", action_size),
            ("wanted", action_size),
            ("state", state_size),
        ):
            values = getattr(self, name)
            if values is not None and len(values) != size:
                return f"its {name} has {len(values)} values, but the layout has {size}"
        for name in ("index", *_NS):
            if abs(getattr(self, name) or 0) > _MAX_INTEGER:
                return f"its {name} is too large"
        if not all(math.isfinite(value) for value in self.action):
            return f"its action is {list(self.action)}"
        if self.driver not in DRIVERS:
            return f"its driver is {self.driver!r}, not one of {', '.join(DRIVERS)}"
        return ""

    def to_json(self) -> dict[str, Any]:
        """Return the step as JSON can hold it; empty fields are left out."""
        plain = msgspec.to_builtins(self, enc_hook=float).items()  # Of NumPy, too.
        return {n: value if n == "frame" else _mapped(_as_json, value) for n, value in plain}

    @classmethod
    def from_json(cls, plain: dict[str, Any]) -> Step:
        """Parse the output of `to_json`.

        Raises:
            ValueError: If a field is missing or invalid.
        """
        known = {name: _mapped(_from_json, value) for name, value in plain.items()}
        try:
            return msgspec.convert(known, cls, strict=False)
        except msgspec.ValidationError as error:
            raise ValueError(f"it is not a valid step ({error})") from error


def _mapped(change: Callable[[Any], Any], value: Any) -> Any:
    """Change a value, or each one of a list or a dictionary."""
    match value:
        case dict():
            items = cast("dict[str, Any]", value).items()
            return {name: change(one) for name, one in items}
        case list() | tuple():
            return [change(one) for one in cast("Sequence[Any]", value)]
        case _:
            return change(value)


def _as_json(value: Any) -> Any:
    """Return a number as JSON can hold it: null for NaN, a string for an infinity."""
    if not isinstance(value, float) or math.isfinite(value):
        return value
    return None if math.isnan(value) else str(value)


def _from_json(value: Any) -> Any:
    return math.nan if value is None else value


class EpisodeMark(msgspec.Struct, frozen=True, tag_field="kind", tag="mark"):
    """A bookmark set by the operator, at the step with an index."""

    step: int
    text: str = ""


class Drop(msgspec.Struct, frozen=True, tag_field="kind", tag="drop"):
    """A range of steps to exclude.

    Attributes:
        first: Index of the first step.
        last: Index of the last step, inclusive.
        why: Such as "undo", "cut" or "bad".
    """

    first: int
    last: int
    why: str = ""


class Keep(Drop, frozen=True, tag="keep"):
    """A range of steps to include again."""


Edit = EpisodeMark | Drop | Keep
"""Lines of `steps.jsonl` other than steps."""


_PAUSE_PERIODS: Final = 30.0
_SHORTEST_PAUSE_S: Final = 1.0  # A disk, or a rate that is not known well, takes this long.
_NS_PER_S: Final = 1e9


def longest_period_s(control_hz: float) -> float:
    """Return the longest time from one step to the next that is not a pause, s."""
    return max(_PAUSE_PERIODS / control_hz, _SHORTEST_PAUSE_S)


def durations_s(times_ns: Sequence[int | None], control_hz: float) -> list[float]:
    """Return how long each step lasted: until the next one, s.

    A step lasts one period if it is the last one, if a pause follows, or if a time is unknown.

    Args:
        times_ns: Time of each step on one clock, ns.
        control_hz: Steps per second.
    """
    period_s, longest_s = 1.0 / control_hz, longest_period_s(control_hz)
    found: list[float] = []
    for now, later in pairwise(times_ns):
        passed_s = -1.0 if now is None or later is None else (later - now) / _NS_PER_S
        found.append(passed_s if 0.0 <= passed_s <= longest_s else period_s)
    return [*found, period_s] if times_ns else []


_MAX_LINE: Final = 1 << 20
"""Length limit of a line in bytes; longer lines are treated as damaged."""

_CHECK: Final = b',"crc":"%08x"}\n'
_CHECK_SIZE: Final = len(_CHECK % 0)


def encode_line(line: Step | Edit | dict[str, Any]) -> bytes:
    """Encode one line of `steps.jsonl`, with the CRC-32 of what precedes it as its last key."""
    fields = line.to_json() if isinstance(line, Step) else msgspec.to_builtins(line)
    text = json.dumps(fields, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    # A lone surrogate has no UTF-8 encoding.
    body = text.encode(errors="replace")[:-1]
    return body + _CHECK % binascii.crc32(body)


def decode_line(line: bytes) -> dict[str, Any]:
    r"""Decode what `encode_line` returned.

    Args:
        line: One line, with its `\n`.

    Raises:
        ValueError: If the line is damaged; the message is part of a sentence.
    """
    if len(line) > _MAX_LINE:
        raise ValueError(f"it has {len(line)} bytes")
    body, check = line[:-_CHECK_SIZE], line[-_CHECK_SIZE:]
    if not body or check != _CHECK % binascii.crc32(body):
        raise ValueError("it is cut off or was changed")
    try:
        fields = json.loads(body + b"}")
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error
    if not isinstance(fields, dict):
        raise ValueError("it is not a JSON object")
    return cast("dict[str, Any]", fields)


def parse_line(line: bytes) -> Step | Edit | None:
    r"""Parse one line of `steps.jsonl`, with its `\n`; None for a kind of a later version.

    Raises:
        ValueError: If the line is damaged or invalid; the message is part of a sentence.
    """
    match decode_line(line):
        case {"kind": "step"} as fields:
            return Step.from_json(fields)
        case {"kind": "mark" | "drop" | "keep"} as fields:
            try:
                return msgspec.convert(fields, Edit)
            except msgspec.ValidationError as error:
                raise ValueError(f"it is not a valid mark or edit ({error})") from error
        case _:
            return None


def split_lines(content: bytes) -> list[bytes]:
    r"""Split the content of a file at each `\n`, which stays; only the last line may lack it."""
    # Not `splitlines`, which also splits at a `\r` that damage may have put there.
    lines = [line + b"\n" for line in content.split(b"\n")]
    last = lines.pop()[:-1]
    return [*lines, last] if last else lines
