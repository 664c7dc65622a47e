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
import io
import re
from collections import defaultdict, deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import Any, Final, cast

from shapechanger.demos.episodes import EpisodeHeader, Step
from shapechanger.demos.exchange.files import (
    Pictures,
    cannot_read,
    name_problem,
    read_text,
    resolve_file,
)
from shapechanger.demos.exchange.importing import ImportContext
from shapechanger.demos.exchange.recorded import (
    ExchangeEpisode,
    ExchangeStep,
    kept_steps,
    rate_hz,
    require_order,
    split_at_gaps,
)
from shapechanger.errors import DemosError
from shapechanger.layout import Feature, Layout

LABELS: Final = "labels.csv"

_KEYS: Final = ("forward", "backward", "right", "left")
_COLUMNS: Final = ("file", *_KEYS)
_LAYOUT: Final = Layout(tuple(Feature(key, "1", 0.0, 1.0) for key in _KEYS))
_ENDINGS: Final = (".jpg", ".jpeg")
_TIME: Final = re.compile(r"([0-9]{1,12}(?:\.[0-9]{1,9})?)(?![0-9])")
_NS_PER_S: Final = 10**9
_MAX_NAMED: Final = 3

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
        DemosError: If something is damaged, missing or contradictory.
    """
    labels, style = _read_labels(folder / LABELS)
    _require_all_labelled(folder, labels)
    times_ns = [label.wall_ns for label in labels]
    require_order(
        times_ns,
        [f"line {label.line}" for label in labels],
        f"sort the lines of {folder / LABELS} by their first column",
    )
    first = Pictures()
    first.read(_picture(folder, labels[0]))
    hz = rate_hz(times_ns)
    for number, part in enumerate(split_at_gaps(times_ns), 1):
        header = EpisodeHeader(
            action_layout=_LAYOUT.to_json(),
            image_size=first.size,
            control_hz=hz,
            clock="none",
            source="2017",
            notes={"files": [label.file for label in labels[part]], "labels": style},
        )
        rows = _rows(folder, labels[part], Pictures(first.size))
        yield ExchangeEpisode(header=header, rows=rows, name=f"{folder}, part {number}")


def write_2017(episodes: Iterable[ExchangeEpisode], folder: Path) -> int:
    """Write episodes into an existing folder; imported pictures get their former names.

    Args:
        episodes: The episodes.
        folder: Where to write.

    Returns:
        Number of steps written.

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


def _rows(folder: Path, labels: Sequence[_Label], pictures: Pictures) -> Iterator[ExchangeStep]:
    for label in labels:
        jpeg = pictures.read(_picture(folder, label))
        step = Step(action=label.held, driver="person", wall_ns=label.wall_ns)
        yield ExchangeStep(step=step, jpeg=jpeg)


def _picture(folder: Path, label: _Label) -> Path:
    return resolve_file(folder, label.file, f"{folder / LABELS}, line {label.line}")


def _read_labels(path: Path) -> tuple[list[_Label], dict[str, Any]]:
    """Return the labels in order, and how they are written, so that an export can repeat it."""
    text = read_text(path)
    labels: list[_Label] = []
    numbers: set[str] = set()
    headed = False
    lines: dict[str, int] = {}
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        for cells in reader:
            if not cells:
                continue
            where = f"{path}, line {reader.line_num}"
            if not labels and tuple(cell.strip().lower() for cell in cells) == _COLUMNS:
                headed = True
                continue
            label = _label(cells, reader.line_num, where)
            if label.file in lines:
                raise DemosError(
                    f"{where} labels {label.file!r}, which line {lines[label.file]} labels "
                    "already: remove one of the two lines."
                )
            lines[label.file] = label.line
            labels.append(label)
            numbers.update(cells[1:])
    except csv.Error as error:
        raise DemosError(f"{path}, line {reader.line_num}, is not valid CSV: {error}.") from error
    if not labels:
        raise DemosError(f"{path} has no labels: a line must be `{','.join(_COLUMNS)}`.")
    style = {
        "header": headed,
        "newline": "\r\n" if "\r\n" in text else "\n",
        "numbers": "0" if numbers <= {"0", "1"} else "0.0",
    }
    return labels, style


def _label(cells: list[str], line: int, where: str) -> _Label:
    if len(cells) != len(_COLUMNS):
        raise DemosError(
            f"{where} has {len(cells)} cells instead of {len(_COLUMNS)}: a line must be "
            f"`{','.join(_COLUMNS)}`."
        )
    name, *words = cells
    held: list[float] = []
    for key, word in zip(_KEYS, words, strict=True):
        try:
            value = float(word)
        except ValueError:
            value = -1.0
        if value not in {0.0, 1.0}:
            raise DemosError(f"{where}: {key} must be 0 or 1, got {word!r}.")
        held.append(abs(value))  # -0.0 is 0.
    if sum(held) > 1.0:
        both = " and ".join(key for key, value in zip(_KEYS, held, strict=True) if value)
        raise DemosError(f"{where} holds {both} at once, but at most one key may be held.")
    if problem := name_problem(name):
        raise DemosError(f"{where}: the name {name!r} {problem}; pictures must be beside {LABELS}.")
    at_ns = _time_ns(name)
    if at_ns is None:
        raise DemosError(
            f"{where}: the name {name!r} does not begin with the Unix time in seconds, as "
            "`1499144070.72_0.1248.jpg` does."
        )
    return _Label(name, tuple(held), at_ns, line)


def _time_ns(name: str) -> int | None:
    """Return the Unix time at the start of a file name, ns; None if there is none."""
    match = _TIME.match(name)
    return int(Decimal(match[1]) * _NS_PER_S) if match else None


def _require_all_labelled(folder: Path, labels: Sequence[_Label]) -> None:
    """Refuse pictures without a label."""
    named = {label.file for label in labels}
    try:
        stray = sorted(
            path.name
            for path in folder.iterdir()
            if path.suffix.lower() in _ENDINGS and path.name not in named
        )
    except OSError as error:
        raise cannot_read(folder, error) from error
    if stray:
        few = ", ".join(stray[:_MAX_NAMED]) + (", ..." if len(stray) > _MAX_NAMED else "")
        raise DemosError(
            f"{len(stray)} of the pictures in {folder} have no line in {LABELS} ({few}): add their "
            "lines, or move them away."
        )


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
