r"""The format of 2017: a folder of JPEGs, and a `labels.csv` with the key held for each.

A line of `labels.csv` is `file,forward,backward,right,left`; the last four are 0 or 1, and at most
one of them is 1. The first line may be this header. A file name begins with the Unix time in
seconds, as in `1499144070.72_0.124813571597.jpg`. The cars of the 2017 authors recorded this way,
with lines ending in `\r\n` and numbers written `0.0` and `1.0`.

An action has four values in [0, 1]: forward, backward, right, left. Pictures, times and file names
are kept, so that a round trip gives the same bytes.
"""

from __future__ import annotations

import csv
import re
from collections import defaultdict, deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, cast

from shapechanger.demos.episodes import EpisodeHeader, Step
from shapechanger.demos.exchange.files import cannot_read, name_problem, read_table, read_text
from shapechanger.demos.exchange.importing import ImportContext, few
from shapechanger.demos.exchange.pictures import check_pictures, read_picture
from shapechanger.demos.exchange.recorded import ExchangeEpisode, ExchangeStep, kept_steps
from shapechanger.demos.exchange.times import TimedDrive, TimeReport, choose_rates, iso_time
from shapechanger.errors import DemosError
from shapechanger.layout import Feature, Layout

LABELS: Final = "labels.csv"

_KEYS: Final = ("forward", "backward", "right", "left")
_COLUMNS: Final = ("file", *_KEYS)
_LAYOUT: Final = Layout(tuple(Feature(key, "1", 0.0, 1.0) for key in _KEYS))
_ENDINGS: Final = (".jpg", ".jpeg")
_TIME: Final = re.compile(r"([0-9]{1,12}(?:\.[0-9]{1,9})?)(?![0-9])")
_NS_PER_S: Final = 10**9

# How `labels.csv` may be written; the first of each is how the cars of 2017 wrote it.
_STYLES: Final[dict[str, tuple[object, object]]] = {
    "header": (False, True),
    "newline": ("\r\n", "\n"),
    "numbers": ("0.0", "0"),
}


@dataclass(frozen=True, slots=True)
class _Label:
    """One line: a picture, which keys were held, and when."""

    file: str
    held: tuple[float, ...]
    wall_ns: int
    line: int


def is_2017(folder: Path) -> bool:
    """Return whether a folder has the format."""
    return (folder / LABELS).is_file()


def read_2017(folder: Path, context: ImportContext) -> Iterator[ExchangeEpisode]:
    """Yield the episodes of a folder: one, unless there are long pauses.

    Raises:
        DemosError: If the table cannot be read.
    """
    labels, style = _read_labels(folder / LABELS, context)
    _leave_out_unlabelled(folder, labels, context)
    paths: list[Path] = []
    found: list[_Label] = []
    for label in _in_order(labels, context):
        path = folder / label.file
        if path.resolve().is_relative_to(folder.resolve()):
            found.append(label)
            paths.append(path)
        else:
            context.leave_out("line", "with a link that leaves the folder", label.line)
    good, size = check_pictures(paths, [str(label.line) for label in found], "line", context)
    labels = [label for label, is_good in zip(found, good, strict=True) if is_good]
    if not labels:
        return
    times_ns = [label.wall_ns for label in labels]
    drive = TimedDrive(times_ns, range(len(labels)), f"line {labels[0].line}")
    (hz,), believed = choose_rates([drive], context)
    report = TimeReport(context)
    names = [f"line {label.line}" for label in labels]
    parts = report.split(times_ns, names, hz) if believed else [slice(None)]
    for number, part in enumerate(parts, 1):
        header = EpisodeHeader(
            action_layout=_LAYOUT.to_json(),
            image_size=size,
            control_hz=hz,
            clock="real" if believed else "none",
            source="2017",
            notes={"files": [label.file for label in labels[part]], "labels": style},
            created=iso_time(labels[part][0].wall_ns) if believed else "",
        )
        rows = _rows(folder, labels[part], timed=believed)
        yield ExchangeEpisode(header=header, rows=rows, name=f"{folder}, part {number}")
    report.finish()


def write_2017(episodes: Iterable[ExchangeEpisode], folder: Path) -> int:
    """Write episodes into an existing folder; imported pictures get their former names.

    Args:
        episodes: The episodes, one after another in one table.
        folder: Folder of the pictures and `labels.csv`.

    Returns:
        Number of lines.

    Raises:
        DemosError: If the actions are not four keys of which at most one is held, or a step has no
            picture or no time.
    """
    lines: list[tuple[str, ...]] = []
    style = {key: values[0] for key, values in _STYLES.items()}
    for episode in episodes:
        names = Layout.from_json(episode.header.action_layout).names
        if names != _KEYS:
            raise DemosError(
                f"The actions of {episode.name} are {', '.join(names)}, and those of the format of "
                f"2017 {', '.join(_KEYS)}: export it to minari or csv."
            )
        style |= _known_style(episode.header.notes.get("labels"))
        former = _former_names(episode.header.notes.get("files"))
        for number, (step, jpeg) in enumerate(kept_steps(episode.rows)):
            where = f"step {number} of {episode.name}"
            if jpeg is None:
                raise DemosError(f"There is no picture at {where}: export it to csv.")
            if step.wall_ns is None:
                raise DemosError(f"The time of {where} is unknown: export it to minari or csv.")
            if sorted(step.action)[:-1] != [0.0] * 3 or max(step.action) not in {0.0, 1.0}:
                raise DemosError(
                    f"The action at {where} is {list(step.action)}, but in the format of 2017 at "
                    "most one value is 1 and the others are 0: export it to minari or csv."
                )
            if known := former.get(step.wall_ns):
                name = known.popleft()
            else:
                seconds = (Decimal(step.wall_ns) / _NS_PER_S).normalize()
                name = f"{seconds:f}_{len(lines):06d}.jpg"
            path = folder / name
            if path.exists():
                raise DemosError(f"Two steps would share the file {name}: export them to csv.")
            path.write_bytes(jpeg)
            form = "{:.0f}" if style["numbers"] == "0" else "{:.1f}"
            lines.append((name, *(form.format(abs(value)) for value in step.action)))
    with (folder / LABELS).open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator=str(style["newline"]))
        if style["header"]:
            writer.writerow(_COLUMNS)
        writer.writerows(lines)
    return len(lines)


def _rows(folder: Path, labels: Sequence[_Label], *, timed: bool) -> Iterator[ExchangeStep]:
    for label in labels:
        step = Step(
            action=label.held,
            driver="person",
            captured_ns=label.wall_ns if timed else None,
            wall_ns=label.wall_ns,
        )
        yield ExchangeStep(step=step, jpeg=read_picture(folder / label.file)[0])


def _in_order(labels: Sequence[_Label], context: ImportContext) -> list[_Label]:
    """Return the labels in the order of their times."""
    falls = [
        (one.wall_ns - two.wall_ns, two.line)
        for one, two in pairwise(labels)
        if two.wall_ns < one.wall_ns
    ]
    if falls:
        context.warn(
            f"Time runs backwards by up to {max(falls)[0] / _NS_PER_S:.6g} s at "
            f"{few([f'line {line}' for _, line in falls])}: the lines are read in the order of "
            "their times."
        )
    return sorted(labels, key=lambda label: label.wall_ns)


def _read_labels(path: Path, context: ImportContext) -> tuple[list[_Label], dict[str, Any]]:
    """Return the labels in order, and how they are written, so that an export can repeat it."""
    labels: list[_Label] = []
    numbers: set[str] = set()
    headed = False
    lines: dict[str, int] = {}
    _, table = read_table(path, len(_COLUMNS))
    for line, cells in table:
        if not labels and tuple(cell.strip().lower() for cell in cells) == _COLUMNS:
            headed = True
            continue
        label = _label(cells, line, context)
        if label is None:
            continue
        if label.file in lines:
            reason = "with the picture of another line"
            context.leave_out("line", reason, f"{label.line} (as {lines[label.file]})")
            continue
        lines[label.file] = label.line
        labels.append(label)
        numbers.update(cells[1:])
    style = {
        "header": headed,
        "newline": "\r\n" if "\r\n" in read_text(path) else "\n",
        "numbers": "0" if numbers <= {"0", "1"} else "0.0",
    }
    return labels, style


def _label(cells: list[str], line: int, context: ImportContext) -> _Label | None:
    """Return a line as a label; None, with a finding, if it is not one."""
    name, *words = cells
    reason = ""
    held: list[float] = []
    at_ns = _time_ns(name)
    if len(cells) != len(_COLUMNS):
        reason = f"that is not `{','.join(_COLUMNS)}`"
    elif problem := name_problem(name):
        reason = f"whose picture's name {problem}"
    elif at_ns is None:
        reason = "whose picture's name does not begin with the Unix time in seconds"
    else:
        held = [number for word in words if (number := _held(word)) is not None]
        if len(held) != len(_KEYS):
            reason = "with a key that is not 0 or 1"
        elif sum(held) > 1.0:
            reason = "with several keys held at once"
    if reason or at_ns is None:
        context.leave_out("line", reason, line)
        return None
    return _Label(name, tuple(held), at_ns, line)


def _held(word: str) -> float | None:
    try:
        value = abs(float(word.replace(",", ".")))  # -0.0 is 0.
    except ValueError:
        return None
    return value if value in {0.0, 1.0} else None


def _time_ns(name: str) -> int | None:
    """Return the Unix time at the start of a file name, ns; None if there is none."""
    match = _TIME.match(name)
    return int(Decimal(match[1]) * _NS_PER_S) if match else None


def _leave_out_unlabelled(folder: Path, labels: Sequence[_Label], context: ImportContext) -> None:
    """Leave out the pictures without a label."""
    named = {label.file for label in labels}
    try:
        children = sorted(path.name for path in folder.iterdir())
    except OSError as error:
        raise cannot_read(folder, error) from error
    for name in children:
        if name.lower().endswith(_ENDINGS) and name not in named:
            context.leave_out("picture", f"without a valid line in {LABELS}", name)


def _former_names(files: object) -> dict[int, deque[str]]:
    """Return the valid file names in the notes of an episode, by their times, ns."""
    found: defaultdict[int, deque[str]] = defaultdict(deque)
    for name in cast("list[object]", files) if isinstance(files, list) else []:
        if isinstance(name, str) and not name_problem(name):
            at_ns = _time_ns(name)
            if at_ns is not None:
                found[at_ns].append(name)
    return found


def _known_style(style: object) -> dict[str, object]:
    """Return the valid part of how the notes of an episode say that labels are written."""
    found = cast("dict[str, object]", style) if isinstance(style, dict) else {}
    return {key: found[key] for key, values in _STYLES.items() if found.get(key) in values}
