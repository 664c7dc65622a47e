"""Records of an episode: its files, the header in `episode.json`, and lines of `steps.jsonl`."""

from __future__ import annotations

import binascii
import fcntl
import io
import json
import math
import os
import re
import stat
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Final, Literal, cast

import msgspec
import numpy as np
from msgspec import Meta

from shapechanger.errors import DemosError, OutputError
from shapechanger.files import converted, read_file, write_atomic, writing
from shapechanger.layout import Layout

HEADER: Final = "episode.json"
STEPS: Final = "steps.jsonl"
FRAMES: Final = "frames"

MAX_TEXT_BYTES: Final = 256 << 20
"""Largest text file to read, bytes. An hour of steps has 30 MB in a car and 200 MB in a finger."""

MAX_PICTURE_BYTES: Final = 16 << 20
"""Largest image to write or read, bytes."""

_MOST_OF_A_NAME: Final = 9999


def is_episode(folder: Path) -> bool:
    """Return whether `folder` contains an episode."""
    return (folder / HEADER).is_file() or (folder / STEPS).is_file()


def free_path(folder: Path, stem: str, ending: str = "") -> Path:
    """Return a path in `folder` that does not exist, with the next free number where needed."""
    counted = re.fullmatch(r"(.*)-([0-9]{4})", stem, re.DOTALL)
    begun, number = (counted[1], int(counted[2])) if counted else (stem, 0)
    if number == _MOST_OF_A_NAME:
        begun, number = stem, 0
    numbered = (f"{begun}-{n:04d}" for n in range(number + 1, _MOST_OF_A_NAME + 1))
    for name in (stem, *numbered):
        if not os.path.lexists(path := folder / f"{name}{ending}"):
            return path
    raise OutputError(f"{folder} has too many files with names like {stem}{ending}.")


def lock(path: Path, busy: str) -> io.FileIO:
    """Open a file for appending, created if missing, and lock it until it is closed.

    Raises:
        DemosError: With the message `busy`, if another process holds the lock.
        OutputError: If the file cannot be opened for writing.
    """
    with writing(path):
        file = io.FileIO(path, "a+")  # Opening a pipe only for writing would block.
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            file.close()
            raise DemosError(busy) from None
    return file


def append(file: io.FileIO, data: bytes) -> None:
    """Append to a file completely, or raise OSError and leave the file as it was."""
    before, written = os.fstat(file.fileno()).st_size, 0
    try:
        while written < len(data):
            written += file.write(data[written:])
    except OSError:
        file.truncate(before)
        raise


_FORMAT: Final = 1  # Readers refuse any other version.

Clock = Literal["real", "twin", "none"]
"""Source of the nanoseconds in steps: a robot's clock, the stepped clock of a twin, or none."""

_Pixels = Annotated[int, Meta(ge=1)]
# A stack of four grey images of 84 x 84, as state, is 28 224 values.
_MAX_VALUES: Final = 1 << 17
_NO_STATES: Final = Layout(())


@dataclass(frozen=True, slots=True, kw_only=True)
class EpisodeHeader:
    """Metadata of an episode.

    Attributes:
        action_layout: Meaning of the values of an action.
        state_layout: Meaning of the values of a state; empty without states.
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
        DemosError: If there is no action, or a layout has too many values.
    """

    action_layout: Layout
    state_layout: Layout = _NO_STATES
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

    @property
    def camera_deg(self) -> tuple[float | None, float | None]:
        """Pitch and vertical field of view of the camera, degrees, as far as they are known."""
        return self.camera_pitch_deg, self.camera_fovy_deg

    def __post_init__(self) -> None:
        # A few bytes can describe more values than any memory holds.
        if not 1 <= self.action_layout.size <= _MAX_VALUES >= self.state_layout.size:
            raise DemosError(
                f"action_layout must have a value, and each layout at most {_MAX_VALUES} values."
            )

    def to_json(self) -> dict[str, Any]:
        """Return the header as JSON can hold it; the layout of no states is None."""
        fields = msgspec.to_builtins(self)
        return fields if self.state_layout else fields | {"state_layout": None}

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
        fields = {name: value for name, value in plain.items() if name != "state_layout" or value}
        return converted(fields, cls, DemosError, "The header is invalid")


Driver = Literal["person", "policy", "expert", "program"]
"""Kinds of drivers: a person, a learned policy, an expert with full state, or a program."""

DRIVERS: Final[tuple[Driver, ...]] = ("person", "policy", "expert", "program")

# The sum of two such numbers fits into the 64-bit integers of NumPy and other formats.
_Integer = Annotated[int, Meta(ge=-(1 << 62), le=1 << 62)]


class StepPicture(msgspec.Struct, frozen=True, array_like=True):
    """The image of a step: file name, size in bytes, and CRC-32 as eight hexadecimal digits."""

    name: Annotated[str, Meta(pattern=r"^[0-9]{6,}\.jpg\Z")]  # Excludes paths to other folders.
    size: Annotated[int, Meta(le=MAX_PICTURE_BYTES)]
    crc: str

    @classmethod
    def of(cls, name: str, jpeg: bytes) -> StepPicture:
        """Return the record of an image."""
        return cls(name, len(jpeg), f"{binascii.crc32(jpeg):08x}")

    def fits(self, jpeg: bytes) -> bool:
        """Return whether an image is the recorded one."""
        return self == StepPicture.of(self.name, jpeg)

    def read(self, frames: Path, *, checksum: bool = True) -> bytes:
        """Read and check the image; without `checksum`, only check its size, and return b"".

        Raises:
            ValueError: If the image is missing or was changed; the message is part of a sentence.
        """
        try:
            found, jpeg = (frames / self.name).stat(), b""
            is_same = stat.S_ISREG(found.st_mode) and found.st_size == self.size
            if is_same and checksum:
                jpeg = read_file(frames / self.name, MAX_PICTURE_BYTES)
        except OSError as error:
            raise ValueError(f"its image {self.name} cannot be read ({error.strerror})") from error
        if not is_same or (checksum and not self.fits(jpeg)):
            raise ValueError(f"its image {self.name} was changed")
        return jpeg


class Step(
    msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True, tag_field="kind", tag="step"
):
    """One step of an episode.

    Attributes:
        index: Position in the episode, from 0; -1 before the step is written.
        driver: Who decided the action.
        action: The action decided for this step's observation, in the order and units of the action
            layout.
        applied: The action after caps, slew limits and reflexes; None if unknown.
        wanted: The action of a policy while another driver drove; None without a policy.
        state: Values of the state layout; NaN for unmeasured values.
        captured_ns: When the image was taken or the state was read; monotonic clock of the robot.
        decided_ns: When the action reached the robot; same clock.
        wall_ns: When the step was recorded; Unix time of the recorder.
        reward: Reward of the step; None without a reward.
        terms: Terms of the reward, keyed by name.
        terminated: Whether the task ended with this step.
        truncated: Whether the episode was cut short at this step.
        stop_reason: Why the robot overrode the action; "" if it did not.
        picture: Its image on disk; None without an image.
    """

    index: _Integer = msgspec.field(default=-1, name="step")
    driver: Driver
    action: tuple[float, ...]
    applied: tuple[float, ...] | None = None
    wanted: tuple[float, ...] | None = None
    state: tuple[float, ...] = ()
    captured_ns: _Integer | None = None
    decided_ns: _Integer | None = None
    wall_ns: _Integer | None = None
    reward: float | None = None
    terms: dict[str, float] = {}
    terminated: bool = False
    truncated: bool = False
    stop_reason: str = ""
    picture: StepPicture | None = msgspec.field(default=None, name="frame")

    @property
    def frame(self) -> str:
        """File name of the image; "" without an image."""
        return "" if self.picture is None else self.picture.name

    @property
    def clock_ns(self) -> int | None:
        """Time of the capture, or else of the decision, on the robot's clock; None if unknown."""
        return self.decided_ns if self.captured_ns is None else self.captured_ns

    def refusal(self, action_size: int, state_size: int) -> str:
        """Return why the step does not fit layouts of these sizes, as part of a sentence, or ""."""
        sizes = dict.fromkeys(("action", "applied", "wanted"), action_size) | {"state": state_size}
        for name, size in sizes.items():
            values = getattr(self, name)
            if values is not None and len(values) != size:
                return f"its {name} has {len(values)} values, but the layout has {size}"
        is_finite = all(map(math.isfinite, self.action))
        return "" if is_finite else f"its action is {list(self.action)}"

    def to_json(self) -> dict[str, Any]:
        """Return the step as JSON can hold it; fields with their default value are left out.

        NaN becomes null, and an infinity a string.
        """

        def change(value: Any) -> Any:
            if not isinstance(value, float) or math.isfinite(value):
                return value
            return None if math.isnan(value) else str(value)

        # The hook converts NumPy numbers.
        return _mapped(change, msgspec.to_builtins(self, enc_hook=float))

    @classmethod
    def from_json(cls, plain: dict[str, Any]) -> Step:
        """Parse the output of `to_json`.

        Raises:
            ValueError: If a field is missing or invalid.
        """
        known = _mapped(lambda value: math.nan if value is None else value, plain)
        return _converted(known, cls, strict=False)


def _mapped(change: Callable[[Any], Any], value: Any) -> Any:
    """Return JSON with each value changed that is neither a list nor an object."""
    match value:
        case dict():
            return {k: _mapped(change, v) for k, v in cast("dict[str, Any]", value).items()}
        case list() | tuple():
            return [_mapped(change, each) for each in cast("Sequence[Any]", value)]
        case _:
            return change(value)


def _converted(fields: Any, kind: Any, *, strict: bool = True) -> Any:
    try:
        return msgspec.convert(fields, kind, strict=strict)
    except msgspec.ValidationError as error:
        raise ValueError(f"it is invalid ({error})") from error


class EpisodeMark(msgspec.Struct, frozen=True, tag_field="kind", tag="mark"):
    """A bookmark set by the operator; `step` is the index of the marked step."""

    step: int
    text: str = ""


class Drop(msgspec.Struct, frozen=True, tag_field="kind", tag="drop"):
    """A range of steps to exclude.

    Attributes:
        first: Index of the first step.
        last: Index of the last step, inclusive.
        why: Reason, such as "undo", "cut" or "bad".
    """

    first: int
    last: int
    why: str = ""


class Keep(Drop, frozen=True, tag="keep"):
    """A range of steps to include again."""


Edit = EpisodeMark | Drop | Keep
"""Lines of `steps.jsonl` other than steps."""

_PAUSE_PERIODS: Final = 30.0
_SHORTEST_PAUSE_S: Final = 1.0  # A slow disk or an imprecise rate causes shorter gaps.
_SAME_RATE: Final = 0.01  # Two recorders at 20 Hz may write 20 and 20.000001.
_MOST_JITTER: Final = 0.25  # Two settings of a rate differ by at least a third.
_MIN_PERIODS: Final = 20


def longest_period_s(control_hz: float) -> float:
    """Return the longest time from one step to the next that is not a pause, s."""
    return max(_PAUSE_PERIODS / control_hz, _SHORTEST_PAUSE_S)


def rate_jitter(periods_s: Sequence[float], control_hz: float) -> float:
    """Return how far the rate of a recording varied, as a share of its nominal rate, `control_hz`.

    It is the larger deviation of the 5th and the 95th percentile of the times between steps,
    `periods_s`, from the nominal period; at most 0.25, and 0 for fewer than 20 times.
    """
    if len(periods_s) < _MIN_PERIODS:
        return 0.0
    low, high = np.percentile(periods_s, (5.0, 95.0)) * control_hz
    return float(min(max(1.0 - low, high - 1.0), _MOST_JITTER))


def is_same_rate(recorded_hz: float, control_hz: float, jitter: float = 0.0) -> bool:
    """Return whether two rates are equal, within 1 % or, if larger, the recording's jitter."""
    allowed = max(_SAME_RATE, min(jitter, _MOST_JITTER))
    return abs(recorded_hz / control_hz - 1.0) <= allowed


_MAX_LINE: Final = 1 << 20  # Bytes; longer lines are treated as damaged.
_CHECK: Final = b',"crc":"%08x"}\n'
_CHECK_SIZE: Final = len(_CHECK % 0)


def encode_line(line: Step | Edit | dict[str, Any]) -> bytes:
    """Encode one line of `steps.jsonl`; its last key is the CRC-32 of the preceding bytes."""
    fields = line.to_json() if isinstance(line, Step) else msgspec.to_builtins(line)
    text = json.dumps(fields, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    # A lone surrogate has no UTF-8 encoding.
    body = text.encode(errors="replace")[:-1]
    return body + _CHECK % binascii.crc32(body)


def parse_line(line: bytes) -> Step | Edit | None:
    r"""Parse one line of `steps.jsonl`, with its `\n`; return None for an unknown kind of line.

    Raises:
        ValueError: If the line is damaged or invalid; the message is part of a sentence.
    """
    if len(line) > _MAX_LINE:
        raise ValueError(f"it has {len(line)} bytes")
    body, check = line[:-_CHECK_SIZE], line[-_CHECK_SIZE:]
    if not body or check != _CHECK % binascii.crc32(body):
        raise ValueError("it is cut off or was changed")
    try:
        match json.loads(body + b"}"):
            case {"kind": "step"} as fields:
                return Step.from_json(cast("dict[str, Any]", fields))
            case {"kind": "mark" | "drop" | "keep"} as fields:
                return _converted(fields, Edit)
            case _:
                return None
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error


def write_header(folder: Path, header: EpisodeHeader, closed: dict[str, Any] | None) -> None:
    """Write the header of an episode atomically; `closed` is its ending, None while it is open."""
    text = json.dumps(header.to_json() | {"closed": closed}, indent=1, ensure_ascii=False)
    write_atomic(folder / HEADER, f"{text}\n".encode())
