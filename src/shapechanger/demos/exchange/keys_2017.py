r"""The layout of 2017: a folder of JPEGs and a `labels.csv` that says which key was held.

Each line of `labels.csv` is `file,forward,backward,right,left`; the last four are 0 or 1, and at
most one of them is 1. The first line may be these words. A file name begins with the Unix time in
seconds, as in `1499144070.72_0.124813571597.jpg`. So the cars of the 2017 authors recorded; lines
end in `\r\n` there, and numbers are written `0.0` and `1.0`.

Four numbers in [0, 1] become the action, in this order: forward, backward, right, left. Pictures
stay as they are, byte for byte, and so do the times and the names of the files.
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
from shapechanger.demos.exchange.pictures import Pictures, size_of
from shapechanger.demos.exchange.places import cannot_read, inside, read_text, refuse_name
from shapechanger.demos.exchange.recorded import (
    ExchangeStep,
    Recorded,
    rate_hz,
    require_order,
    seen,
    split_at_gaps,
)
from shapechanger.errors import DemosError
from shapechanger.layout import Feature, Layout

__all__ = [
    "COLUMNS",
    "KEYS",
    "LABELS",
    "LABELS_LAYOUT",
    "PICTURE_ENDINGS",
    "read_2017",
    "time_ns",
    "write_2017",
]

LABELS: Final = "labels.csv"
KEYS: Final = ("forward", "backward", "right", "left")
COLUMNS: Final = ("file", *KEYS)
PICTURE_ENDINGS: Final = (".jpg", ".jpeg")

LABELS_LAYOUT: Final = Layout(tuple(Feature(key, "1", 0.0, 1.0) for key in KEYS))
"""What the numbers of an action mean."""

_TIME: Final = re.compile(r"([0-9]{1,12}(?:\.[0-9]{1,9})?)(?![0-9])")
_NS_PER_S: Final = 10**9
_MOST_NAMED: Final = 3


@dataclass(frozen=True, slots=True)
class _Label:
    """One line: which keys were held on which picture, and when."""

    file: str
    held: tuple[float, ...]
    wall_ns: int
    line: int


def read_2017(folder: Path) -> Iterator[Recorded]:
    """The episodes of a folder: one, unless the times have long gaps.

    Raises:
        DemosError: If the folder is not whole; the sentence says what to do.
    """
    labels, style = _read_labels(folder / LABELS)
    _require_all_labelled(folder, labels)
    times_ns = [label.wall_ns for label in labels]
    require_order(
        times_ns,
        [f"line {label.line}" for label in labels],
        f"sort the lines of {folder / LABELS} by their first column",
    )
    first = inside(folder, labels[0].file, _said_by(folder, labels[0]))
    try:
        size = size_of(first.read_bytes(), str(first))
    except OSError as error:
        raise cannot_read(first, error) from error
    hz = rate_hz(times_ns)
    for number, part in enumerate(split_at_gaps(times_ns)):
        header = EpisodeHeader(
            action_layout=LABELS_LAYOUT.to_json(),
            image_size=size,
            control_hz=hz,
            clock="none",
            source="2017",
            notes={"files": [label.file for label in labels[part]], "labels": style},
        )
        pictures = Pictures(size)
        rows = _rows(folder, labels[part], pictures)
        yield Recorded(header=header, rows=rows, name=f"{folder}, part {number + 1}")


def time_ns(name: str) -> int | None:
    """The Unix time with which a file name begins, ns; None if it does not."""
    match = _TIME.match(name)
    return int(Decimal(match[1]) * _NS_PER_S) if match else None


def _rows(folder: Path, labels: Sequence[_Label], pictures: Pictures) -> Iterator[ExchangeStep]:
    for label in labels:
        jpeg = pictures.read(inside(folder, label.file, _said_by(folder, label)))
        step = Step(action=label.held, driver="person", wall_ns=label.wall_ns)
        yield ExchangeStep(step=step, jpeg=jpeg)


def _said_by(folder: Path, label: _Label) -> str:
    return f"{folder / LABELS}, line {label.line}"


def _read_labels(path: Path) -> tuple[list[_Label], dict[str, Any]]:
    r"""The labels in order, and how they are written, so that they can be written so again."""
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
            if not labels and tuple(cell.strip().lower() for cell in cells) == COLUMNS:
                headed = True
                continue
            label = _label(cells, reader.line_num, where)
            if label.file in lines:
                raise DemosError(
                    f"{where} labels {label.file!r}, which line {lines[label.file]} has labelled "
                    "already: take one of the two lines out."
                )
            lines[label.file] = label.line
            labels.append(label)
            numbers.update(cells[1:])
    except csv.Error as error:
        raise DemosError(
            f"{path}, line {reader.line_num}, is no line of a CSV file: {error}."
        ) from error
    if not labels:
        raise DemosError(f"{path} labels nothing: a line is `{','.join(COLUMNS)}`.")
    style = {
        "header": headed,
        "newline": "\r\n" if "\r\n" in text else "\n",
        "numbers": "0" if numbers <= {"0", "1"} else "0.0",
    }
    return labels, style


def _label(cells: list[str], line: int, where: str) -> _Label:
    if len(cells) != len(COLUMNS):
        raise DemosError(
            f"{where} has {len(cells)} cells in place of {len(COLUMNS)}: a line is "
            f"`{','.join(COLUMNS)}`."
        )
    name, *words = cells
    held: list[float] = []
    for key, word in zip(KEYS, words, strict=True):
        try:
            value = float(word)
        except ValueError:
            value = -1.0
        if value not in {0.0, 1.0}:
            raise DemosError(f"{where}: {key} is {word!r}, and it is 0 or 1.")
        held.append(abs(value))  # -0.0 is 0.
    if sum(held) > 1.0:
        both = " and ".join(key for key, value in zip(KEYS, held, strict=True) if value)
        raise DemosError(f"{where} holds {both} at once, and at most one key is held: choose one.")
    if why := refuse_name(name):
        raise DemosError(f"{where}: the name {name!r} {why}; pictures lie beside {LABELS}.")
    at_ns = time_ns(name)
    if at_ns is None:
        raise DemosError(
            f"{where}: the name {name!r} does not begin with the Unix time in seconds, as "
            "`1499144070.72_0.1248.jpg` does."
        )
    return _Label(name, tuple(held), at_ns, line)


def _require_all_labelled(folder: Path, labels: Sequence[_Label]) -> None:
    """Refuse pictures that no line names."""
    named = {label.file for label in labels}
    try:
        stray = sorted(
            path.name
            for path in folder.iterdir()
            if path.suffix.lower() in PICTURE_ENDINGS and path.name not in named
        )
    except OSError as error:
        raise cannot_read(folder, error) from error
    if stray:
        few = ", ".join(stray[:_MOST_NAMED]) + (", ..." if len(stray) > _MOST_NAMED else "")
        raise DemosError(
            f"{len(stray)} of the pictures in {folder} have no line in {LABELS} ({few}): add their "
            "lines, or move them away."
        )


_AS_IN_2017: Final = {"header": False, "newline": "\r\n", "numbers": "0.0"}


def write_2017(episodes: Iterable[Recorded], folder: Path) -> int:
    """Write episodes into a folder that is there.

    What was imported from this layout gets the names back that it had.

    Returns:
        How many steps were written.

    Raises:
        DemosError: If an episode is not of four keys, of which at most one is held, or a step has
            no picture or no time.
    """
    lines: list[tuple[str, ...]] = []
    style: dict[str, Any] = dict(_AS_IN_2017)
    for episode in episodes:
        _require_keys(episode)
        style |= _known(episode.header.notes.get("labels"))
        names = _Names(episode.header.notes.get("files"))
        for number, (step, jpeg) in enumerate(seen(episode.rows)):
            where = f"step {number} of {episode.name}"
            if jpeg is None:
                raise DemosError(f"There is no picture at {where}: export it to csv.")
            if step.wall_ns is None:
                raise DemosError(f"Nobody knows when {where} was: export it to minari or csv.")
            if sorted(step.action)[:-1] != [0.0] * 3 or max(step.action) not in {0.0, 1.0}:
                raise DemosError(
                    f"The action at {where} is {list(step.action)}, and in the layout of 2017 at "
                    "most one number is 1 and the others are 0: export it to minari or csv."
                )
            name = names.of(step.wall_ns, len(lines))
            path = folder / name
            if path.exists():
                raise DemosError(f"Two steps belong into one file, {name}: export them to csv.")
            path.write_bytes(jpeg)
            form = "{:.0f}" if style["numbers"] == "0" else "{:.1f}"
            lines.append((name, *(form.format(abs(value)) for value in step.action)))
    with (folder / LABELS).open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator=str(style["newline"]))
        if style["header"]:
            writer.writerow(COLUMNS)
        writer.writerows(lines)
    return len(lines)


class _Names:
    """The file names that pictures had, by their times.

    Args:
        files: Names, as the notes of an episode say them; anything else is nobody's name.
    """

    def __init__(self, files: object) -> None:
        self._by_time: defaultdict[int, deque[str]] = defaultdict(deque)
        for name in cast("list[object]", files) if isinstance(files, list) else []:
            if isinstance(name, str) and not refuse_name(name):
                at_ns = time_ns(name)
                if at_ns is not None:
                    self._by_time[at_ns].append(name)

    def of(self, wall_ns: int, number: int) -> str:
        """The name that the picture of this time had, or a new one."""
        if known := self._by_time.get(wall_ns):
            return known.popleft()
        return f"{(Decimal(wall_ns) / _NS_PER_S).normalize():f}_{number:06d}.jpg"


def _known(style: object) -> dict[str, Any]:
    """What the notes of an episode say of how labels are written, as far as it can be."""
    found = cast("dict[str, Any]", style) if isinstance(style, dict) else {}
    allowed = {"header": (True, False), "newline": ("\r\n", "\n"), "numbers": ("0", "0.0")}
    return {key: found[key] for key, values in allowed.items() if found.get(key) in values}


def _require_keys(episode: Recorded) -> None:
    names = Layout.from_json(episode.header.action_layout).names
    if names != KEYS:
        raise DemosError(
            f"The actions of {episode.name} are {', '.join(names)}, and those of the layout of "
            f"2017 {', '.join(KEYS)}: export it to minari or csv."
        )
