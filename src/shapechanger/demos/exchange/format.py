"""Formats of datasets: column names, declaration, findings, and episodes for export."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from itertools import pairwise
from pathlib import Path
from typing import Final, Literal, cast

from shapechanger.demos.episodes import Episode, EpisodeHeader, Step
from shapechanger.demos.episodes.records import longest_period_s
from shapechanger.errors import DemosError
from shapechanger.layout import Feature, Layout

Kind = Literal["action", "state", "picture", "time", "number", "flag", "text", "json", "index"]


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a step.

    Attributes:
        field: Its name in a step.
        kind: Its type; "action" and "state" are vectors, "time" is a whole number of ns.
        names: Its name in each format that has it.
        aliases: Names in tables of others, each with its factor to the unit of the field.
    """

    field: str
    kind: Kind
    names: Mapping[str, str]
    aliases: Mapping[str, float]


_FORMATS: Final = ("csv", "minari", "lerobot", "tub", "mcap")
_NAMES: Final = """
step        | index   | step        |                    | frame_index               | _index          | /step
frame       | picture | frame       | observations/image | observation.images.camera | cam/image_array | /camera
driver      | text    | driver      | infos/driver       |                           | user/mode       | /step
action      | action  | action/     | actions            | action                    | user/, pilot/   | /action
applied     | action  | applied/    | infos/applied      |                           |                 | /applied
wanted      | action  | wanted/     | infos/wanted       |                           | pilot/          | /wanted
state       | state   | state/      | observations/state | observation.state         | other numbers   | /state
captured_ns | time    | captured_ns | infos/captured_ns  | timestamp                 | _timestamp_ms   | log time
decided_ns  | time    | decided_ns  | infos/decided_ns   |                           |                 | log time
wall_ns     | time    | wall_ns     | infos/wall_ns      |                           | _timestamp_ms   | /step
reward      | number  | reward      | rewards            | next.reward               |                 | /reward
terms       | json    | terms       | infos/more         |                           |                 | /reward
terminated  | flag    | terminated  | terminations       | next.terminated           |                 | /step
truncated   | flag    | truncated   | truncations        | next.done                 |                 | /step
stop_reason | text    | stop_reason | infos/stop_reason  |                           |                 | /step
marks       | json    | marks       | infos/more         |                           |                 | /step
dropped     | text    | dropped     | infos/more         |                           |                 | /step
"""  # noqa: E501
_ALIASES: Final[dict[str, dict[str, float]]] = {
    "frame": dict.fromkeys(("file", "image", "picture", "filename"), 1.0),
    "captured_ns": {"timestamp": 1e9, "time": 1e9, "timestamp_ms": 1e6, "milliseconds": 1e6},
    "terminated": {"done": 1.0},
}


def _column(line: str) -> Column:
    field, kind, *names = (cell.strip() for cell in line.split("|"))
    named = {form: name for form, name in zip(_FORMATS, names, strict=True) if name}
    return Column(field, cast("Kind", kind), named, _ALIASES.get(field, {}))


COLUMNS: Final = tuple(map(_column, _NAMES.strip().splitlines()))
"""All columns of a step, in the order of `steps.csv`."""

BY_FIELD: Final = {column.field: column for column in COLUMNS}

COMMANDS: Final = {
    "steering": Feature("steering", "1", -1.0, 1.0),
    "angle": Feature("steering", "1", -1.0, 1.0),
    "throttle": Feature("throttle", "1", -1.0, 1.0),
    **{key: Feature(key, "1", 0.0, 1.0) for key in ("forward", "backward", "right", "left")},
}
"""Values of an action by their names in tables of others; a key that is held is 1."""


def fields_of(*kinds: Kind) -> tuple[str, ...]:
    """Return the names of the fields of some kinds."""
    return tuple(column.field for column in COLUMNS if column.kind in kinds)


def name_in(form: str, field: str) -> str:
    """Return the name of a field in a format."""
    return BY_FIELD[field].names[form]


def as_markdown() -> str:
    """Return the table for the documentation."""
    lines = [("Field", *_FORMATS), ("---",) * (1 + len(_FORMATS))]
    for column in COLUMNS:
        named = (f"`{name}`" if (name := column.names.get(form)) else "" for form in _FORMATS)
        lines.append((f"`{column.field}`", *named))
    return "\n".join(f"| {' | '.join(cells)} |".replace("|  |", "| |") for cells in lines)


DEFAULT_HZ: Final = 20.0
"""Steps per second of an episode without any information on its rate, Hz."""

_MAX_NAMED: Final = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class ExchangeStep:
    """One step between two formats.

    Attributes:
        step: The step; its index and the name of its frame are ignored.
        jpeg: Its picture; None for that of the step before, or without a camera.
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


class ImportContext:
    """Options of an import, and its findings so far.

    A reader yields what is whole. It calls `leave_out` for each part that it skips, `warn` where a
    source contradicts itself or is implausible, and `note` for what is neither lost nor wrong. With
    `strict`, the import is refused at the end if there is anything of the first two kinds.

    Args:
        camera: Name of the camera to take, if there are several; "" for the only one.
        hz: Steps per second, as stated by the user; None to read or measure them.
        strict: Whether to refuse a source that is incomplete or contradicts itself.

    Attributes:
        left_out: Names of the parts that are left out, by what they are and by the reason.
        warnings: Contradictions, as sentences that state their size.
        notes: Further facts, as sentences.
    """

    def __init__(self, *, camera: str = "", hz: float | None = None, strict: bool = False) -> None:
        self.camera = camera
        self.hz = hz
        self.strict = strict
        self.left_out: dict[tuple[str, str], list[str]] = {}
        self.warnings: list[str] = []
        self.notes: list[str] = []

    def leave_out(self, what: str, reason: str, name: object) -> None:
        """Note that a part is left out."""
        self.left_out.setdefault((what, reason), []).append(str(name))

    def warn(self, sentence: str) -> None:
        """Note a contradiction in the source, once."""
        if sentence not in self.warnings:
            self.warnings.append(sentence)

    def note(self, sentence: str) -> None:
        """Note a fact that is neither a loss nor a contradiction, once."""
        if sentence not in self.notes:
            self.notes.append(sentence)

    def left_out_lines(self) -> list[str]:
        """Return a line for each reason, such as "9 records with an empty picture: 31, 32, ...".

        The reason with most parts is first.
        """
        groups = sorted(self.left_out.items(), key=lambda group: -len(group[1]))
        return [
            f"{counted(len(names), what)} {reason}: {few(names)}"
            for (what, reason), names in groups
        ]

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
        images: Whether to store pictures as they were recorded, in place of video.
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
    shown = ", ".join(map(str, names[:_MAX_NAMED]))
    more = len(names) - _MAX_NAMED
    return f"{shown}, and {more} more" if more > 0 else shown


def kept_steps(rows: Iterable[ExchangeStep]) -> Iterator[tuple[Step, bytes | None]]:
    """Yield the steps that are not excluded, each with its picture, even where it is shared."""
    picture: bytes | None = None
    for row in rows:
        picture = picture if row.jpeg is None else row.jpeg
        if row.dropped is None:
            yield row.step, picture


_NS_PER_S: Final = 1e9


def exchange_episode(
    episode: Episode, *, dropped: bool = False, part: range | None = None
) -> ExchangeEpisode:
    """Return an episode for export; its pictures are read step by step."""
    rows = _rows(episode, dropped=dropped, part=part)
    return ExchangeEpisode(
        header=episode.header, rows=rows, name=episode.path.name, outcome=episode.outcome
    )


def consecutive_parts(
    episodes: Sequence[Episode], form: Format, *, dropped: bool = False
) -> tuple[list[ExchangeEpisode], list[str]]:
    """Split episodes where steps are excluded or missing, and at pauses."""
    parts: list[ExchangeEpisode] = []
    off_s: list[float] = []
    pauses_s: list[float] = []
    whole = missing = 0
    for episode in episodes:
        steps = episode.steps if dropped else episode.kept
        whole += bool(steps)
        longest_s = longest_period_s(episode.header.control_hz)
        starts = [0] if steps else []
        for number, (one, two) in enumerate(pairwise(steps), 1):
            passed_s = _passed_s(one, two)
            if two.index != one.index + 1:
                missing += 1
            elif passed_s is not None and passed_s > longest_s:
                pauses_s.append(passed_s)
            else:
                continue
            starts.append(number)
        for start, end in pairwise([*starts, len(steps)]):
            indexes = range(steps[start].index, steps[end - 1].index + 1)
            part = exchange_episode(episode, dropped=dropped, part=indexes)
            header = replace(part.header, created=_started(episode, steps[start]))
            outcome = part.outcome if end == len(steps) else ""
            parts.append(replace(part, header=header, outcome=outcome))
            off_s.append(_off_s(steps[start:end], episode.header))
    notes: list[str] = []
    if len(parts) > whole:
        where = [f"excluded or missing steps ({missing} times)"] if missing else []
        if pauses_s:
            where.append(f"pauses ({len(pauses_s)}, up to {max(pauses_s):.4g} s)")
        notes.append(
            f"Episodes are split at {' and '.join(where)}, because {form.title} takes each "
            f"step for the successor of the one before: {whole} became {len(parts)}."
        )
    if (late_s := [by_s for by_s in off_s if by_s > 0.0]) and not form.timed:
        notes.append(
            f"{form.title} takes the time of a step to be its number divided by the rate, "
            f"which is off by more than half a period in {len(late_s)} of {len(parts)} "
            f"episodes, by up to {max(late_s):.4g} s."
        )
    return parts, notes


def _off_s(steps: Sequence[Step], header: EpisodeHeader) -> float:
    """Return how far times are off those by the rate, s; 0 for less than half a period."""
    since_s = [_passed_s(steps[0], step) for step in steps]
    off_s = max(
        abs(at_s - number / header.control_hz) if at_s is not None else 0.0
        for number, at_s in enumerate(since_s)
    )
    return off_s if off_s > 0.5 / header.control_hz else 0.0


def _passed_s(one: Step, two: Step) -> float | None:
    """Return the time between two steps on the robot's clock, s; None if it is unknown."""
    for now, later in ((one.decided_ns, two.decided_ns), (one.captured_ns, two.captured_ns)):
        if now is not None and later is not None:
            return (later - now) / _NS_PER_S
    return None


def _started(episode: Episode, first: Step) -> str:
    """Return when a part of an episode began, ISO 8601; that of the episode if unknown."""
    since_s = _passed_s(episode.steps[0], first) or 0.0
    try:
        began = datetime.fromisoformat(episode.header.created) + timedelta(seconds=since_s)
    except (ValueError, OverflowError):
        return episode.header.created
    return began.isoformat(timespec="milliseconds")


def value_names(layout: Layout) -> list[str]:
    """Return a name for each value of a layout; those of a block are numbered, as in `map[3]`."""
    return [
        feature.name if not feature.shape else f"{feature.name}[{place}]"
        for feature in layout
        for place in range(feature.size)
    ]


def require_alike(episodes: Sequence[ExchangeEpisode], dataset: str) -> None:
    """Refuse episodes that do not fit into one dataset."""
    first, *others = episodes
    for episode in others:
        theirs = _kind(episode.header)
        for what, ours in _kind(first.header).items():
            if ours != theirs[what]:
                raise DemosError(
                    f"{first.name} has {what} {ours}, and {episode.name} {theirs[what]}: {dataset} "
                    "has one kind of episode, so export each kind to a dataset of its own."
                )


def _kind(header: EpisodeHeader) -> dict[str, str]:
    """Describe what all episodes of a dataset have in common."""
    action, state = (
        ", ".join(map(str, Layout.from_json(layout))) if layout else "none"
        for layout in (header.action_layout, header.state_layout)
    )
    size = "no size" if header.image_size is None else "{} x {}".format(*header.image_size)
    rate = f"{header.control_hz:g}"
    return {
        "the actions": action, "the state": state, "pictures of": size, "steps a second:": rate
    }  # fmt: skip


def _rows(episode: Episode, *, dropped: bool, part: range | None) -> Iterator[ExchangeStep]:
    newest = episode.steps[-1].index if episode.steps else -1
    kept = {step.index for step in episode.kept}
    why = {
        index: drop.why
        for drop in episode.drops
        if not drop.keep
        for index in range(max(0, drop.first), min(drop.last, newest) + 1)
    }
    marks: dict[int, tuple[str, ...]] = {}
    for mark in episode.marks:
        marks[mark.step] = (*marks.get(mark.step, ()), mark.text)
    frame = ""
    for step in episode.steps:
        excluded = step.index not in kept
        if (excluded and not dropped) or (part is not None and step.index not in part):
            continue
        jpeg = episode.jpeg(step) if step.frame != frame else None
        frame = step.frame
        yield ExchangeStep(
            step=step,
            jpeg=jpeg,
            marks=marks.get(step.index, ()),
            dropped=why.get(step.index, "") if excluded else None,
        )
