"""Formats of datasets: their declaration, the names of their columns, and steps on their way."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.episodes import EpisodeHeader, Step
from shapechanger.demos.jpeg import decode_picture
from shapechanger.errors import DemosError
from shapechanger.layout import Feature

FORMATS: Final = ("csv", "minari", "lerobot", "tub", "mcap")
_NAMES: Final = """
step        | step        |                    | frame_index               | _index          | /step
frame       | frame       | observations/image | observation.images.camera | cam/image_array | /camera
driver      | driver      | infos/step         |                           | user/mode       | /step
action      | action/     | actions            | action                    | user/, pilot/   | /action
applied     | applied/    | infos/step         |                           |                 | /applied
wanted      | wanted/     | infos/step         |                           | pilot/          | /wanted
state       | state/      | observations/state | observation.state         | other numbers   | /state
captured_ns | captured_ns | infos/step         | timestamp                 | _timestamp_ms   | log time
decided_ns  | decided_ns  | infos/step         |                           |                 | log time
wall_ns     | wall_ns     | infos/step         |                           | _timestamp_ms   | /step
reward      | reward      | rewards            | next.reward               |                 | /reward
terms       | terms       | infos/step         |                           |                 | /reward
terminated  | terminated  | terminations       | next.terminated           |                 | /step
truncated   | truncated   | truncations        | next.done                 |                 | /step
stop_reason | stop_reason | infos/step         |                           |                 | /step
marks       | marks       | infos/step         |                           |                 | /step
dropped     | dropped     | infos/step         |                           |                 | /step
"""  # noqa: E501
COLUMNS: Final = {
    field: {form: name for form, name in zip(FORMATS, names, strict=True) if name}
    for field, *names in (map(str.strip, row.split("|")) for row in _NAMES.split("\n")[1:-1])
}
"""Names of the fields of a step in each format that has them, in the order of `steps.csv`."""

COMMANDS: Final = {
    "steering": Feature("steering", "1", -1.0, 1.0),
    "angle": Feature("steering", "1", -1.0, 1.0),
    "throttle": Feature("throttle", "1", -1.0, 1.0),
    **{key: Feature(key, "1", 0.0, 1.0) for key in ("forward", "backward", "right", "left")},
}
"""Values of an action by their names in tables of others; a key that is held is 1."""


DEFAULT_HZ: Final = 20.0
"""Steps per second of an episode without any information on its rate, Hz."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExchangeStep:
    """One step between two formats.

    Attributes:
        step: The step; its index and the name of its frame are ignored.
        jpeg: Its image; None for that of the step before, or without a camera.
        marks: Texts of its marks.
        dropped: Why the step is excluded; None if it is not.
    """

    step: Step
    jpeg: bytes | None
    marks: tuple[str, ...] = ()
    dropped: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ExchangeEpisode:
    """One episode between two formats.

    Attributes:
        header: Its metadata.
        rows: Its steps in order; they can be iterated once, at any time.
        name: How to name the episode in errors.
        outcome: How it ended; "" if unspecified.
    """

    header: EpisodeHeader
    rows: Iterable[ExchangeStep]
    name: str
    outcome: str = ""


@dataclass(slots=True, kw_only=True)
class ImportContext:
    """Options of an import, and its findings so far.

    A reader yields what is whole. It calls `leave_out` for each part that it skips, `warn` where a
    source contradicts itself or is implausible, and `note` for what is neither lost nor wrong. With
    `strict`, the import is refused at the end if there is anything of the first two kinds.

    Attributes:
        camera: Name of the camera to take, if there are several; "" for the only one.
        hz: Steps per second, as stated by the user; None to read or measure them.
        strict: Whether to refuse a source that is incomplete or contradicts itself.
        left_out: Names of the parts that are left out, by what they are and by the reason.
        warnings: Contradictions, as sentences that state their size.
        notes: Further facts, as sentences.
    """

    camera: str = ""
    hz: float | None = None
    strict: bool = False
    left_out: dict[tuple[str, str], list[str]] = field(
        default_factory=dict[tuple[str, str], list[str]]
    )
    warnings: list[str] = field(default_factory=list[str])
    notes: list[str] = field(default_factory=list[str])

    def leave_out(self, what: str, reason: str, name: object) -> None:
        """Report that a part is left out."""
        self.left_out.setdefault((what, reason), []).append(str(name))

    def warn(self, sentence: str) -> None:
        """Report a contradiction in the source, once."""
        self.warnings += [sentence] if sentence not in self.warnings else []

    def note(self, sentence: str) -> None:
        """Report a fact that is neither a loss nor a contradiction, once."""
        self.notes += [sentence] if sentence not in self.notes else []

    def left_out_lines(self) -> list[str]:
        """Return a line for each reason, such as "9 records with an empty image: 31, 32, ...".

        The reason with most parts is first.
        """
        groups = sorted(self.left_out.items(), key=lambda group: -len(group[1]))
        return [f"{counted(len(n), what)} {reason}: {few(n)}" for (what, reason), n in groups]

    def require_whole(self, source: object) -> None:
        """Refuse a source of which something is left out, or which contradicts itself."""
        findings = [f"left out: {line}" for line in self.left_out_lines()]
        findings += [warning.removesuffix(".") for warning in self.warnings]
        if findings:
            raise DemosError(
                f"{source} is not whole ({'; '.join(findings)}): repair it, or import it with "
                "`shapechanger demos import` and without --strict."
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportContext:
    """Options of an export.

    Attributes:
        out: The folder that the user asked for; a writer gets another one, which is moved there.
        task: What the robot does, in words; "" if not given.
        images: Whether to store images as they were recorded, instead of video.
        rewarded: Whether all steps have a reward.
    """

    out: Path
    task: str = ""
    images: bool = False
    rewarded: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Format:
    """Declaration of a format, which a module binds to a name and an entry point names.

    Attributes:
        name: Its name on the command line.
        title: Its name in sentences.
        sign: Files by which a folder of the format is known, such as "steps.csv".
        detect: Returns whether a folder has the format; None if it cannot be imported.
        read: Yields the episodes of a folder, and tells the context what it leaves out.
        write: Writes episodes into an existing folder and returns the number of steps; None if the
            format cannot be exported.
        options: Options that it takes: "camera" and "hz" on import; "task", "images" and "dropped"
            (excluded steps, marked as such) on export.
        consecutive: Whether each step follows the one before, so that an export splits episodes.
        timed: Whether it keeps the times of steps.
    """

    name: str
    title: str
    sign: str = ""
    detect: Callable[[Path], bool] | None = None
    read: Callable[[Path, ImportContext], Iterator[ExchangeEpisode]] | None = None
    write: Callable[[Sequence[ExchangeEpisode], Path, ExportContext], int] | None = None
    options: frozenset[str] = frozenset()
    consecutive: bool = False
    timed: bool = True


def counted(number: int, what: str) -> str:
    """Format a count, such as "1 record" or "2 records"."""
    return f"{number} {what}{'' if number == 1 else 's'}"


def few(names: Sequence[object]) -> str:
    """List the first few names and count the rest, such as "12, 15, 20, and 286 more"."""
    shown = ", ".join(map(str, names[:3]))
    return f"{shown}, and {len(names) - 3} more" if len(names) > 3 else shown


def kept_steps(rows: Iterable[ExchangeStep]) -> Iterator[tuple[Step, bytes | None]]:
    """Yield the steps that are not excluded, each with its image, even where it is shared."""
    picture: bytes | None = None
    for row in rows:
        picture = picture if row.jpeg is None else row.jpeg
        if row.dropped is None:
            yield row.step, picture


def decoded_steps(
    rows: Iterable[ExchangeStep], size: tuple[int, int] | None, name: str, title: str
) -> Iterator[tuple[ExchangeStep, bytes, NDArray[np.uint8] | None]]:
    """Yield steps for a dataset with an image at every step, each with its image.

    Args:
        rows: The steps.
        size: Width and height of all images; None without images.
        name: How to name the episode in errors.
        title: How to name the format in errors.

    Yields:
        The step; its image, also if it is shared; and its pixels if it is new, shape
        (height, width, 3).
    """
    jpeg = b""
    for number, row in enumerate(rows):
        pixels, where = None, f"of step {number} of {name}"
        if size is not None and row.jpeg is not None:
            jpeg, pixels = row.jpeg, decode_picture(row.jpeg, where)
            height, width, _ = pixels.shape
            if (width, height) != size:
                raise DemosError(
                    f"The image {where} has {width} x {height} pixels, and not {size[0]} x "
                    f"{size[1]}: a {title} dataset has one size."
                )
        if size is not None and not jpeg:
            raise DemosError(f"There is no image {where}, but {title} needs one at every step.")
        yield row, jpeg, pixels


def value_names(layout: Iterable[Feature]) -> list[str]:
    """Return a name for each value of a layout; those of a block are numbered, as in `map[3]`."""
    return [
        f"{feature.name}[{place}]" if feature.shape else feature.name
        for feature in layout
        for place in range(feature.size)
    ]
