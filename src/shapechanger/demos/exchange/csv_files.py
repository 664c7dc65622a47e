"""CSV: a folder with `header.json`, `steps.csv` and `frames/` for each episode.

Numbers are written so that they are read back exactly; an empty cell is a missing value, `nan` a
value that nothing measured. Texts are written as JSON with its quotes, so that no spreadsheet takes
one for a formula, and line ends and other special characters survive.

Without a header, `steps.csv` is a table of others: its columns are known by their names or aliases
of them, and its images lie in the same folder.
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal
from itertools import chain
from pathlib import Path
from typing import Any, Final

import msgspec

from shapechanger.demos.episodes import EpisodeHeader, Step
from shapechanger.demos.exchange import base, files
from shapechanger.errors import DemosError, translate_errors
from shapechanger.layout import Layout, value_names

_TABLE: Final = "steps.csv"
_HEADER: Final = "header.json"
_FRAMES: Final = "frames"
_NAMES: Final = {field: names["csv"] for field, names in base.COLUMNS.items()}
_VECTORS: Final = [field for field, name in _NAMES.items() if name.endswith("/")]
_IN_JSON: Final = ("terms", "stop_reason", "marks", "dropped")
_KNOWN_AS: Final = {
    **{key: (_NAMES["action"] + one.name, 1) for key, one in base.COMMANDS.items()},
    **dict.fromkeys(("file", "image", "picture", "filename"), ("frame", 1)),
    **dict.fromkeys(("timestamp", "time"), ("captured_ns", 10**9)),
    **dict.fromkeys(("timestamp_ms", "milliseconds"), ("captured_ns", 10**6)),
    "done": ("terminated", 1),
}
"""Columns of `steps.csv`, each with its factor to their unit, by names in tables of others."""

_Table = list[tuple[int, list[str]]]  # Lines with their numbers.

_Columns = Mapping[str, Sequence[str]]  # The names of the columns of each field of a step.


def _tables_of(folder: Path) -> list[Path]:
    """Return the folders with a `steps.csv`: the folder itself, or its subfolders."""
    if (folder / _TABLE).is_file():
        return [folder]
    return sorted(path.parent for path in folder.glob(f"*/{_TABLE}") if path.is_file())


def _columns(header: EpisodeHeader) -> dict[str, list[str]]:
    actions, states = value_names(header.action_layout), value_names(header.state_layout)
    values = dict.fromkeys(_VECTORS, actions) | {"state": states}
    return {
        field: [name + value for value in values.get(field, [""])] for field, name in _NAMES.items()
    }


def _write(episodes: Sequence[base.ExchangeEpisode], folder: Path, _: base.ExportContext) -> int:
    """Write episodes; several episodes get a subfolder each."""
    steps = 0
    for number, episode in enumerate(episodes, 1):
        place = folder if len(episodes) == 1 else folder / f"episode-{number:04d}"
        (place / _FRAMES).mkdir(parents=True)
        own = episode.header.to_json() | {"outcome": episode.outcome}
        text = json.dumps(own, indent=1, ensure_ascii=False)
        (place / _HEADER).write_text(text + "\n", encoding="utf-8", errors="replace")
        columns, frame, shown = _columns(episode.header), "", None
        with (place / _TABLE).open("w", encoding="utf-8", errors="replace", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(chain.from_iterable(columns.values()))
            for index, record in enumerate(episode.records):
                if record.jpeg is not None and record.jpeg is not shown:
                    frame, shown = f"{index:06d}.jpg", record.jpeg
                    (place / _FRAMES / frame).write_bytes(shown)
                writer.writerow([index, frame, record.step.driver, *_cells(record, columns)])
                steps += 1
    return steps


def _cells(record: base.ExchangeRecord, columns: _Columns) -> Iterator[str]:
    """Yield the cells of a step after those of its index, image and driver."""
    for field, names in list(columns.items())[3:]:
        value: Any = getattr(record if field in {"marks", "dropped"} else record.step, field)
        if field in _VECTORS:
            yield from [""] * len(names) if value is None else map(repr, value)
        elif field == "terms":  # JSON has neither NaN nor infinity.
            terms = {n: v if math.isfinite(v) else repr(v) for n, v in value.items()}
            yield json.dumps(terms) if terms else ""
        elif field == "dropped":  # For an unknown reason, which is "".
            yield "" if value is None else json.dumps(value)
        elif field in _IN_JSON:
            yield json.dumps(value) if value else ""
        else:
            yield "" if value is None else repr(value).lower()


def _read(folder: Path, context: base.ImportContext) -> Iterator[base.ExchangeEpisode]:
    for place in _tables_of(folder):
        path = place / _TABLE
        (_, names), *lines = files.read_table(path) or [(1, [])]
        names = [name.strip() for name in names]
        read = _own if (place / _HEADER).is_file() else _others
        yield from read(path, names, lines, context)


def _own(
    path: Path, names: list[str], lines: _Table, context: base.ImportContext
) -> Iterator[base.ExchangeEpisode]:
    if context.hz is not None:
        raise DemosError("The format csv states the rate itself: leave out --hz.")
    where, own = path.parent / _HEADER, files.read_json(path.parent / _HEADER)
    ((header, outcome, _),) = files.own_episodes({"format": 1, "episodes": [own]}, where, 1)
    columns = _columns(header)
    expected = list(chain.from_iterable(columns.values()))
    if names != expected:
        wrong = ", ".join(sorted(set(names) ^ set(expected))[:5]) or "their order"
        raise DemosError(f"{path} has other columns than {where}: {wrong}.")
    records = _records(path.parent / _FRAMES, names, lines, columns, None)
    if header.image_size is None and any(record.frame for record in records):
        raise DemosError(f"{path} has images, but {where} has no image_size.")
    yield base.ExchangeEpisode(
        header=header, records=records, name=str(path.parent), outcome=outcome
    )


def _others(
    path: Path, stated: list[str], lines: _Table, context: base.ImportContext
) -> Iterator[base.ExchangeEpisode]:
    """Yield the episodes of a table without a header."""
    known = dict(_KNOWN_AS.get(name.lower(), (name, 1)) for name in stated)
    columns = {
        field: [n for n in known if (n.startswith(name) if field in _VECTORS else n == name)]
        for field, name in _NAMES.items()
    }
    if not columns["action"]:
        names = ", ".join(base.COMMANDS)
        raise DemosError(f"{path} has neither a {_HEADER} nor a column action/NAME, or {names}.")
    if len(known) < len(stated):
        raise DemosError(f"{path} has two columns of one name: rename one of them.")
    if others := known.keys() - set(chain.from_iterable(columns.values())):
        context.report("note", f"Columns that are not imported: {', '.join(sorted(others))}.")
    layouts: list[Layout] = []
    for field in ("action", "state"):
        values = [name.removeprefix(_NAMES[field]) for name in columns[field]]
        features = (base.COMMANDS.get(name) or base.features_of(name, 1)[0] for name in values)
        layouts.append(Layout(tuple(features)))
    header = EpisodeHeader(action_layout=layouts[0], state_layout=layouts[1], source="csv")
    records = _records(path.parent, list(known), lines, columns, known)
    for part, head in base.drives([records], header, context):
        name = f"{path.parent}, from {part[0].name}"
        yield base.ExchangeEpisode(header=head, records=part, name=name)


def _records(
    folder: Path,
    names: Sequence[str],
    lines: _Table,
    columns: _Columns,
    factors: Mapping[str, int] | None,
) -> list[base.ExchangeRecord]:
    """Return the lines of a table with their images.

    An own table has no `factors` of columns, and the tables of others may lack columns.
    """
    records: list[base.ExchangeRecord] = []
    shown, known, last = "", set[str](), -1
    for position, (line, cells) in enumerate(lines):
        record = base.ExchangeRecord(step=Step(action=(), driver="person"), number=position)
        record.name = f"line {line} of {folder.parent.name if factors is None else folder.name}"
        records.append(record)
        try:
            if len(cells) != len(names):
                raise ValueError(f"{len(cells)} cells instead of {len(names)}")
            frame = _fill(record, dict(zip(names, cells, strict=True)), columns, factors)
            if factors is None and record.step.index <= last:
                raise ValueError(f"step {record.step.index} is not after the step before")
            last = record.step.index
            record.frame, record.image = frame, folder / frame if frame else None
            if frame and not files.is_inside(folder, frame):
                raise ValueError("an image name that leaves the folder")
            if shown and not frame:
                raise ValueError("no image")
            if frame != shown and frame in known:
                raise ValueError(f"it returns to the image {frame!r} of an earlier step")
            shown = frame
            known.add(frame)
        except (ValueError, RecursionError, msgspec.ValidationError) as error:
            record.fault = str(error)
    return records


def _fill(
    record: base.ExchangeRecord,
    cells: Mapping[str, str],
    columns: _Columns,
    factors: Mapping[str, int] | None,
) -> str:
    """Fill a record from the cells of a line, and return the name of its image."""
    fields: dict[str, Any] = {} if factors is None else {"driver": "person"}
    for field, names in columns.items():
        values = [cell for name in names if (cell := cells[name].strip())]
        factor = (factors or {}).get(names[0], 1) if names else 1
        if field in _VECTORS:
            fields |= {field: values} if values else {}
        elif not values:
            if factors is None and field in {"terminated", "truncated"}:
                raise ValueError(f"{names[0]} is empty")
        elif field in _IN_JSON:
            fields[field] = json.loads(values[0])
        elif factor > 1:
            wrong = f"{names[0]} is not a time: {values[0]!r}"
            with translate_errors(ArithmeticError, to=lambda _, wrong=wrong: ValueError(wrong)):
                fields[field] = int((Decimal(values[0]) * factor).quantize(1))
        else:
            fields[field] = values[0]
    sizes = [len(columns[field]) for field in ("action", "state")]
    fields.setdefault("state", [math.nan] * sizes[1])
    marks, dropped, frame = (fields.pop(name, None) for name in ("marks", "dropped", "frame"))
    step = Step.from_json(fields)
    if reason := step.refusal(*sizes):
        raise ValueError(reason)
    record.marks = msgspec.convert(marks or (), tuple[str, ...])
    record.dropped = msgspec.convert(dropped, str | None)
    record.step = step
    return frame or ""


FORMAT: Final = base.Format(
    name="csv",
    title="CSV",
    sign=_TABLE,
    detect=lambda folder: bool(_tables_of(folder)),
    read=_read,
    write=_write,
    options=frozenset({"dropped", "hz"}),
)
